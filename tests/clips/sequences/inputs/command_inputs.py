"""Rows of `inputs_tried.py` about words of a command line, things that are no clip, and the commands after prepare."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import one_view
from builders import builder
from common_folder import written
from depth_folders import true_depth
from input_kinds import P, Row, calibrated, close, depth_is_true, folder_of, prepare, size, video, with_files
from made_videos import HEIGHT, WIDTH, files, picture, pictures, write
from scoped_scenes import scene, through_a_scope

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.sequence_file import FILE_NAME, read_sequence_file


@builder
def common(folder: Path, *words: str, command="check", change=lambda clip: None, **changes) -> list[str]:
    """A folder in the common format."""
    written(folder / "clip", **changes)
    change(folder / "clip")
    return [command, str(folder / "clip"), *words]


@builder
def each(clip: Path, name, change) -> None:
    for file in sorted((clip / name).iterdir()):
        write_png(file, change(read_png(file)))


@builder
def one_camera(folder: Path, values, *words, points=0) -> list[str]:
    """A clip from one camera with the files of a network, and true depth at some points beside it."""
    where, given = one_view.clip(folder, values)
    if points:
        one_view.sparse(where, points)
    return ["depth", str(where), "--given", str(given), "--kind", "relative", *words]


def frozen(clip: Path) -> None:
    first = read_png(clip / "images/000000.png")
    each("images", lambda x: first)(clip)


def scope(folder: Path) -> list[str]:
    """A round field of view with an instrument, as a video."""
    write(folder / "a.mp4", through_a_scope(scene("pulling")[0])[0], options={"crf": "20"})
    return ["masks", str(folder / "a.mp4"), "--out", str(folder / "o")]


@builder
def exported_as(folder: Path, name: str, *words: str) -> list[str]:
    sys.path.insert(0, str(Path(__file__).parents[3] / "results" / "export"))
    from made_up_model import moving_scene

    from endotsr.results.export.files import export

    export(moving_scene(), folder / "a.npz")
    return ["export", str(folder / "a.npz"), "--out", str(folder / name), *words]


@builder
def text_file(folder: Path, name: str, content: bytes) -> list[str]:
    (folder / name).write_bytes(content)
    return prepare(name)(folder)


def small_label(plane: np.ndarray) -> np.ndarray:
    """A mask in which two objects have the numbers 1 and 2, on few pixels."""
    found = np.zeros_like(plane)
    found[:4, :4], found[8:12, :4] = 2, 1
    return found


@builder
def disparity(folder: Path, times: float, *words: str, marked: bool = False) -> list[str]:
    """Disparities of a clip as 16-bit PNG, or with a sign and -16 at pixels without a match, as OpenCV has them."""
    where, given = one_view.clip(folder, lambda i: 1800 / true_depth(i))
    text, file = where / "sequence.toml", read_sequence_file(where)
    text.write_text(text.read_text().replace("baseline = 0.0", "baseline = 4.0"))
    for k, one_file in enumerate(sorted(given.iterdir())):
        pixels = file.camera.fx * 4.0 / true_depth(k)
        stored = np.rint(pixels * times).astype(np.uint16)
        one_file.unlink()
        if marked:
            stored[:2] = -16 & 0xFFFF
            np.save(one_file, stored.astype(np.int16))
        else:
            write_png(one_file.with_suffix(".png"), stored)
    return ["depth", str(where), "--given", str(given), "--kind", "disparity", *words]


def depth_of_disparity(folder: Path) -> bool:
    found = describe(next(folder.glob("*/sequence.toml")).parent).depth
    return found is not None and np.abs(found(2) - true_depth(2))[2:].max() < 1


def empty(folder: Path) -> list[str]:
    (folder / "clip").mkdir()
    return prepare("clip")(folder)


def zipped(folder: Path) -> list[str]:
    files(folder, "clip", pictures())
    with zipfile.ZipFile(folder / "clip.zip", "w") as archive:
        for file in (folder / "clip").iterdir():
            archive.write(file, file.name)
    return prepare("clip.zip")(folder)


@builder
def edited(folder: Path, name: str, change) -> list[str]:
    """A text file of the common format with other bytes."""
    words = common()(folder)
    file = folder / "clip" / name
    file.write_bytes(change(file.read_bytes()))
    return words


def prepared(folder: Path, *words: str) -> Path:
    """A folder in the common format without masks and depth."""
    main(folder_of(red_and_grey(), *words)(folder))
    return folder / "o"


def red_and_grey() -> list[np.ndarray]:
    """Red tissue with a grey instrument in the middle."""
    found = pictures()
    for shown in found:
        shown[20:60, 40:80] = shown[20:60, 40:80].mean(axis=2, keepdims=True)
    return found


@builder
def keys(folder: Path, value_inside: int, value_outside: int, *words: str) -> list[str]:
    """Masks of two key frames with these numbers on the instrument and beside it."""
    clip = prepared(folder)
    plane = np.full((HEIGHT, WIDTH), value_outside, np.uint8)
    plane[20:60, 40:80] = value_inside
    (folder / "k").mkdir()
    for i in (0, 6):
        write_png(folder / "k" / f"{i:06d}.png", plane)
    return ["masks", str(clip), "--keys", str(folder / "k"), *words]


@builder
def given(folder: Path, factor: float) -> list[str]:
    """True depth times a factor, as files for `endotsr depth`."""
    clip = prepared(folder)
    files(folder, "d", [(factor * true_depth(i)).astype(np.float32) for i in range(12)], "npy")
    return ["depth", str(clip), "--given", str(folder / "d"), "--kind", "depth"]


def videos_in_a_folder(folder: Path) -> list[str]:
    (folder / "clip").mkdir()
    for name in ("part 1.mp4", "part 2.mp4"):
        write(folder / "clip" / name, pictures(4))
    return prepare("clip")(folder)


def one_plane(clip: Path) -> None:
    """The depth of the first frame in the place of all."""
    first = read_png(clip / "depth/000000.png")
    for file in (clip / "depth").iterdir():
        write_png(file, first)


MILLISECONDS = [40.0 * i for i in range(5)]


def named_file(name: str):
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(bytes(99))
        return prepare(name)(folder)

    return make


COMMAND_ROWS = [
    Row("common format, masks inverted", common(change=each("masks", lambda x: 255 - x)), "refused",
        "set --sequence.excluded-value black"),
    Row("common format, masks inverted, the remedy", common("--sequence.excluded-value", "black", change=each("masks",
        lambda x: 255 - x)), "right", "ready for training"),
    Row("common format, black pictures", common(change=each("images", lambda x: x * 0)), "refused", "no-picture"),
    Row("common format, one picture for ever", common(change=frozen), "refused", "constant-clip"),
    Row("common format, a mask over everything", common(change=lambda clip: write_png(clip / "masks/000002.png",
        np.full((24, 32), 255, np.uint8))), "told", "frame-without-tissue"),
    Row("common format, times that go back", common(times=[0.0, 0.1, 0.3, 0.2, 0.4]), "refused", "ascending seconds"),
    Row("common format, uneven times", common(times=[0.0, 0.1, 0.2, 0.9, 1.0]), "told", "uneven-times"),
    Row("common format, a small object of another number in the masks", common(change=each("masks", small_label)),
        "refused", "numbers up to 2"),
    Row("common format, further files, check", common(change=with_files("times.txt", "gt_masks/0.png")), "told",
        "not read: gt_masks/, times.txt"),
    Row("common format, masks that sequence.toml does not state, check", common(masks=False,
        change=with_files("masks/0.png")), "told", "not read: masks/"),
    Row("common format, further files, inspect", common(command="inspect", change=with_files("times.txt")), "told",
        "not read: times.txt"),
    Row("common format, sequence.toml with a byte order mark and CRLF", edited(FILE_NAME,
        lambda data: b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n")), "right", ""),
    Row("common format, sequence.toml with decimal commas", edited(FILE_NAME, lambda data: data.replace(b"fx = 3",
        b"fx = 3,")), "refused", FILE_NAME),
    Row("depth, of one frame for all, check", common(change=one_plane), "told", "the depth of 5 frames is that of 1"),
    Row("times in milliseconds, check", common(times=MILLISECONDS), "told", "0.025 frames a second, 40 s between two"),
    Row("a time in the place of the rate, check", common(frame_rate=0.04), "told", "0.04 frames a second"),
    Row("a rate in microseconds, check", common(frame_rate=40000.0), "told", "4e+04 frames a second"),
    Row("common format, another number of frames, check", common(frames=6), "refused", "correct the key"),
    Row("masks of a round field of view", scope, "told", "field of view: ",
        lambda folder: all(0.3 < (read_png(file) > 0).mean() < 0.8 for file in (folder / "o/masks").iterdir())),
    Row("keys, white everywhere", keys(255, 255), "refused", "leave hardly any tissue in all 12 frames"),
    Row("keys, a margin wider than the picture", keys(255, 0, "--margin", "500"), "refused", "a smaller --margin"),
    Row("keys, inverted", keys(0, 255), "told", "seem to be inverted"),
    Row("one camera, relative depth, points to compare with", one_camera(lambda i: 1800 / true_depth(i) - 3,
        "--replace", points=60), "told", "scale and shift from the depth before", depth_is_true),
    Row("one camera, relative depth alone", one_camera(lambda i: 1800 / true_depth(i) - 3), "told",
        "not metric (scale and shift of the depth assumed)"),
    Row("one camera, relative depth that grows with distance", one_camera(lambda i: true_depth(i) / 99), "refused",
        "near tissue is bright"),
    Row("one camera, no depth at all", video("a.mp4"), "told", "--kind relative"),
    Row("disparity times 256", disparity(256), "refused", "--unit-scale 0.00390625"),
    Row("disparity times 16 of OpenCV", disparity(16), "refused", "--unit-scale 0.0625"),
    Row("disparity times 16 of OpenCV, of far tissue", disparity(16 / 3, marked=True), "refused",
        "-16 marks pixels without a match; disparities times 16"),
    Row("disparity times 16 of OpenCV, --unit-scale", disparity(16, "--unit-scale", "0.0625", marked=True), "right", "",
        depth_of_disparity),
    Row("disparity times 256, --unit-scale", disparity(256, "--unit-scale", "0.00390625"), "right", "",
        depth_of_disparity),
    Row("depth, a plane once in millimetres times 100, given", given(100), "told", "the median depth is 5"),
    *(Row(f"export to {name}", exported_as(name, *words), "refused", "use FILE.ply") for name, *words in (("a.spz",),
        ("a.splat",), ("a.obj", "--content", "mesh"), ("a.gltf", "--content", "mesh"))),
    Row("text named .mp4", text_file("a.mp4", b"hello " * 99), "refused", "not a video by its first bytes"),
    Row("play list named .mp4", text_file("a.mp4", b"#EXTM3U\nfile:///etc/passwd\n"), "refused", "not a video by its"),
    Row("empty file named .mp4", text_file("a.mp4", b""), "refused", "not a video by its first bytes"),
    Row("a folder above the pictures", calibrated("calib.txt", P.format("P2", 4), folders=["first try"]), "refused",
        "it holds the folders first try;"),
    Row("a zip file", zipped, "refused", "an archive; unpack it first"),
    Row("a folder that is not there", prepare("nothing"), "refused", "not found"),
    Row("an empty folder", empty, "refused", "the folder is empty"),
    Row("a folder of videos", videos_in_a_folder, "refused", "it holds part 1.mp4, part 2.mp4; give the video itself"),
    Row("a video of another format", lambda folder: ((folder / "a.y4m").write_text("YUV4MPEG2 W128 H96 F25:1\n"),
        prepare("a.y4m")(folder))[1], "refused", "a video in a format that is not read; convert it to mp4"),
    Row("a path with backslashes", lambda folder: [w.replace("/clip", "\\clip") for w in folder_of(pictures())(folder)],
        "refused", "not found; write strokes in place of backslashes"),
    Row("a bag of ROS 2", named_file("a.db3"), "refused", "a ROS bag; export its pictures"),
    Row("a presentation", named_file("a.pptx"), "refused", "a presentation; export its pictures"),
    Row("an address", lambda folder: ["prepare", "https://example.org/a.mp4", "--out", str(folder / "o")], "refused",
        "is an address; download the file"),
    Row("a pattern of names", lambda folder: [*folder_of(pictures())(folder)[:1], str(folder / "clip/%04d.png"),
        *prepare("clip")(folder)[2:]], "refused", "give the folder of the pictures"),
    Row("a device in place of a file", lambda folder: ["prepare", "/dev/null", "--out", str(folder / "o")], "refused",
        "is neither a file nor a folder"),
    Row("a rate as a fraction", folder_of(pictures(), "--source-rate", "30000/1001"), "refused", "use a number"),
    Row("frames by second and frames left out", video("a.mp4", None, "--frames", "0s:0.24s", "--drop", "1"), "told",
        "not evenly spaced", close([picture(i) for i in (0, 2, 3, 4, 5)])),
    Row("frames beyond the end", video("a.mp4", None, "--frames", "0s:9s"), "refused", "ends after 0.440 seconds"),
    Row("crop", video("a.mp4", None, "--crop", "8", "4", "64", "48"), "told", "the intrinsics follow", size(64, 48)),
    Row("crop outside", video("a.mp4", None, "--crop", "100", "4", "64", "48"), "refused", "leaves the pictures"),
    Row("--frames with a hyphen", folder_of(pictures(), "--frames", "0-5"), "refused", "--frames"),
    Row("--scale 0", folder_of(pictures(), "--scale", "0"), "refused", "scale"),
    Row("--rate below 0", video("a.mp4", None, "--rate", "-5"), "refused", "rate"),
    Row("frames to drop beyond the end", folder_of(pictures(), "--drop", "99"), "refused",
        "--drop '99': 99 is outside"),
    Row("camera, numbers with commas", folder_of(pictures(), "--camera", "100,100,64,48"), "refused",
        "use a number, apart from the others: --camera 100 100 64 48"),
    *(Row(f"crop as {word}", folder_of(pictures(), "--crop", word), "refused",
        f"--crop '{word}' is not allowed; " f"use an integer, {how}") for word, how in (("100x80+10+12",
        "as X Y WIDTH HEIGHT: --crop 10 12 100 80"), ("crop=100:80:10:12", "as X Y WIDTH HEIGHT: --crop 10 12 100 80"),
        ("10:12:100:80", "as X Y WIDTH HEIGHT"), ("10,12,100,80", "apart from the others: --crop 10 12 100 80"))),
    Row("rate with a decimal comma", folder_of(pictures(), "--source-rate", "29,97"), "refused",
        "use a number, with a decimal point (29.97)"),
    Row("baseline with a unit", folder_of(pictures(), "--baseline", "4.2 mm"), "refused",
        "use a number, without a unit (4.2)"),
    Row("frames in words", folder_of(pictures(), "--frames", "first"), "refused", "'first': not a range"),
    Row("an option behind the dash of a text program", folder_of(pictures(), "\N{EM DASH}scale", "0.5"), "refused",
        "did you mean --scale?"),
]  # fmt: skip
