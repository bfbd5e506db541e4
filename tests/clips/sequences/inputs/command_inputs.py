"""Rows of `inputs_tried.py` about words of a command line, things that are no clip, and the commands after prepare."""

import sys
from pathlib import Path

import numpy as np
import one_view
from builders import builder
from common_folder import written
from depth_folders import true_depth
from input_kinds import (
    changed_bytes,
    each,
    folder_of,
    prepare,
    put,
    replaced,
    twelve,
    video,
    with_files,
)
from input_rows import close, depth_is_true, refused, right, size, told
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
def one_camera(folder: Path, values, *words, points=0) -> list[str]:
    """A clip from one camera with the files of a network, and true depth at some points beside it."""
    where, given = one_view.clip(folder, values)
    if points:
        one_view.sparse(where, points)
    return ["depth", str(where), "--given", str(given), "--kind", "relative", *words]


@builder
def as_first(clip: Path, name: str) -> None:
    """The first picture, or depth of the first frame, in the place of all."""
    first = read_png(clip / name / "000000.png")
    each(name, lambda plane: first)(clip)


def unprepared(command: str, name: str):
    """A command for prepared clips, on a recording."""
    made = video("a.mp4") if name == "a.mp4" else twelve()
    return lambda folder: made(folder) and [command, str(folder / name)]


def edited(change):
    """sequence.toml of the common format with other bytes."""
    return common(change=lambda clip: changed_bytes(change)(clip / FILE_NAME))


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
def one_file(folder: Path, name: str, what: object = bytes(99)) -> list[str]:
    """A file alone, or what a function makes; see `put`."""
    put(folder / name, what)
    return prepare(name)(folder)


@builder
def disparity(folder: Path, times: float, *words: str, marked: bool = False) -> list[str]:
    """Disparities of a clip as 16-bit PNG, or with a sign and -16 at pixels without a match, as OpenCV has them."""
    where, given = one_view.clip(folder, lambda i: 1800 / true_depth(i))
    replaced(FILE_NAME, "baseline = 0.0", "baseline = 4.0")(where)
    for k, file in enumerate(sorted(given.iterdir())):
        stored = np.rint(read_sequence_file(where).camera.fx * 4.0 / true_depth(k) * times).astype(np.uint16)
        file.unlink()
        if marked:
            stored[:2] = -16 & 0xFFFF
            np.save(file, stored.astype(np.int16))
        else:
            write_png(file.with_suffix(".png"), stored)
    return ["depth", str(where), "--given", str(given), "--kind", "disparity", *words]


def depth_of_disparity(folder: Path) -> bool:
    found = describe(next(folder.glob("*/sequence.toml")).parent).depth
    return found is not None and np.abs(found(2) - true_depth(2))[2:].max() < 1


def prepared(folder: Path) -> str:
    """A folder in the common format without masks and depth: red tissue with a grey instrument in the middle."""
    shown = pictures()
    for frame in shown:
        frame[TOOL] = frame[TOOL].mean(axis=2, keepdims=True)
    main(folder_of(shown)(folder))
    return str(folder / "o")


TOOL = slice(20, 60), slice(40, 80)


@builder
def keys(folder: Path, value_inside: int, value_outside: int, *words: str) -> list[str]:
    """Masks of two key frames with these numbers on the instrument and beside it."""
    plane = np.full((HEIGHT, WIDTH), value_outside, np.uint8)
    plane[TOOL] = value_inside
    (folder / "k").mkdir()
    for i in (0, 6):
        write_png(folder / f"k/{i:06d}.png", plane)
    return ["masks", prepared(folder), "--keys", str(folder / "k"), *words]


@builder
def given(folder: Path, factor: float) -> list[str]:
    """True depth times a factor, as files for `endotsr depth`."""
    files(folder, "d", [(factor * true_depth(i)).astype(np.float32) for i in range(12)], "npy")
    return ["depth", prepared(folder), "--given", str(folder / "d"), "--kind", "depth"]


@builder
def given_inverse(folder: Path, kind: str, *words: str, then: tuple[str, ...] = ()) -> list[str]:
    """Inverse depth of a network in 8 bits, each frame stretched to the full range, for pictures that it lights."""
    near = [1 / true_depth(i) for i in range(12)]
    planes = [np.round(255 * (x - x.min()) / (x.max() - x.min())).astype(np.uint8) for x in near]
    shown = [np.stack([60 + plane * 0.7, plane * 0.4, plane * 0.3], axis=2).astype(np.uint8) for plane in planes]
    main(folder_of(shown)(folder))
    files(folder, "d", planes, "png")
    command = ["depth", str(folder / "o"), "--given", str(folder / "d"), "--kind", kind, *words]
    if not then:
        return command
    main(command)
    return [*command[:4], *then]


def videos(folder: Path) -> None:
    folder.mkdir()
    for name in ("part 1.mp4", "part 2.mp4"):
        write(folder / name, pictures(4))


SMALL = np.zeros((24, 32), np.uint8)  # a mask in which two objects have the numbers 1 and 2, on few pixels
SMALL[:4, :4], SMALL[8:12, :4] = 2, 1
COMMAND_ROWS = [
    refused("common format, masks inverted", common(change=each("masks", lambda x: 255 - x)),
        "set --sequence.excluded-value black"),
    right("common format, masks inverted, the remedy", common("--sequence.excluded-value", "black", change=each("masks",
        lambda x: 255 - x))),
    refused("common format, black pictures", common(change=each("images", lambda x: x * 0)), "no-picture"),
    refused("common format, one picture for ever", common(change=as_first("images")), "constant-clip"),
    told("common format, a mask over everything", common(change=lambda clip: write_png(clip / "masks/000002.png",
        np.full((24, 32), 255, np.uint8))), "frame-without-tissue"),
    refused("common format, times that go back", common(times=[0.0, 0.1, 0.3, 0.2, 0.4]), "ascending seconds"),
    told("common format, uneven times", common(times=[0.0, 0.1, 0.2, 0.9, 1.0]), "uneven-times"),
    refused("common format, a small object of another number in the masks", common(change=each("masks",
        lambda plane: SMALL)), "numbers up to 2"),
    told("common format, further files, check", common(change=with_files("times.txt", "gt_masks/0.png")),
        "not read: gt_masks/, times.txt"),
    told("common format, masks that sequence.toml does not state, check", common(masks=False,
        change=with_files("masks/0.png")), "not read: masks/"),
    told("common format, further files, inspect", common(command="inspect", change=with_files("times.txt")),
        "not read: times.txt"),
    right("common format, sequence.toml with a byte order mark and CRLF",
        edited(lambda data: b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n"))),
    refused("common format, sequence.toml with decimal commas", edited(lambda data: data.replace(b"fx = 3",
        b"fx = 3,")), FILE_NAME),
    told("depth, of one frame for all, check", common(change=as_first("depth")), "the depth of 5 frames is that of 1"),
    told("times in milliseconds, check", common(times=[0.0, 40.0, 80.0, 120.0, 160.0]),
        "0.025 frames a second, 40 s between two"),
    told("a time in the place of the rate, check", common(frame_rate=0.04), "0.04 frames a second"),
    refused("common format, another number of frames, check", common(frames=6), "correct the key"),
    told("masks of a round field of view", scope, "field of view: ",
        lambda folder: all(0.3 < (read_png(file) > 0).mean() < 0.8 for file in (folder / "o/masks").iterdir())),
    refused("keys, white everywhere", keys(255, 255), "leave hardly any tissue in all 12 frames"),
    refused("keys, a margin wider than the picture", keys(255, 0, "--margin", "500"), "a smaller --margin"),
    told("keys, inverted", keys(0, 255), "seem to be inverted"),
    told("one camera, relative depth, points to compare with", one_camera(lambda i: 1800 / true_depth(i) - 3,
        "--replace", points=60), "scale and shift from the depth before", depth_is_true),
    told("one camera, relative depth alone", one_camera(lambda i: 1800 / true_depth(i) - 3),
        "not metric (scale and shift of the depth assumed)"),
    refused("one camera, relative depth that grows with distance", one_camera(lambda i: true_depth(i) / 99),
        "near tissue is bright"),
    told("one camera, no depth at all", video("a.mp4"), "--kind relative"),
    refused("disparity times 256", disparity(256), "--unit-scale 0.00390625"),
    refused("disparity times 16 of OpenCV, of far tissue", disparity(16 / 3, marked=True),
        "-16 marks pixels without a match; disparities times 16"),
    right("disparity times 16 of OpenCV, --unit-scale", disparity(16, "--unit-scale", "0.0625", marked=True),
        depth_of_disparity),
    told("depth, a plane once in millimetres times 100, given", given(100), "the median depth is 5"),
    *(refused(f"export to {name}", exported_as(name, *words), "use FILE.ply") for name, *words in (("a.spz",),
        ("a.gltf", "--content", "mesh"))),
    refused("play list named .mp4", one_file("a.mp4", b"#EXTM3U\nfile:///etc/passwd\n"), "not a video by its"),
    refused("a folder above the pictures", one_file("clip", lambda path: files(path, "first try", pictures())),
        "it holds the folders first try;"),
    refused("a zip file", one_file("a.zip", b"PK\3\4"), "an archive; unpack it first"),
    refused("a folder that is not there", prepare("nothing"), "not found"),
    refused("depth, a folder that is not there", lambda folder: ["depth", str(folder / "clip")], "clip: not found"),
    refused("depth of a video", unprepared("depth", "a.mp4"), "is a file, and no folder with sequence.toml; `endotsr"),
    refused("poses of a folder of pictures", unprepared("poses", "clip"), " --out FOLDER` writes a folder with one"),
    refused("pictures one by one", lambda folder: [*twelve()(folder)[:2], str(folder / "clip"), "--out", "o"],
            "a second path; give one, such as the folder"),
    refused("field of view in radians", lambda folder: [*video("a.mp4")(folder)[:4], "--field-of-view", "1.2"],
            "1.2 radians are 68.8 degrees"),
    refused("an empty folder", one_file("clip", Path.mkdir), "the folder is empty"),
    refused("a folder of videos", one_file("clip", videos), "it holds part 1.mp4, part 2.mp4; give the video itself"),
    refused("a video of another format", one_file("a.y4m", "YUV4MPEG2 W128 H96 F25:1\n"),
        "a video in a format that is not read; convert it to mp4"),
    refused("a path with backslashes", lambda folder: [w.replace("/clip", "\\clip") for w in twelve()(folder)],
        "not found; write strokes in place of backslashes"),
    refused("a bag of ROS 2", one_file("a.db3"), "a ROS bag; export its pictures"),
    refused("a presentation", one_file("a.pptx"), "a presentation; export its pictures"),
    refused("an address", lambda folder: ["prepare", "https://example.org/a.mp4", "--out", str(folder / "o")],
        "is an address; download the file"),
    refused("a pattern of names", lambda folder: [*twelve()(folder)[:1], str(folder / "clip/%04d.png"),
        *prepare("clip")(folder)[2:]], "give the folder of the pictures"),
    refused("a device in place of a file", lambda folder: ["prepare", "/dev/null", "--out", str(folder / "o")],
        "is neither a file nor a folder"),
    told("frames by second and frames left out", video("a.mp4", None, "--frames", "0s:0.24s", "--drop", "1"),
        "not evenly spaced", close([picture(i) for i in (0, 2, 3, 4, 5)])),
    refused("frames beyond the end", video("a.mp4", None, "--frames", "0s:9s"), "ends after 0.440 seconds"),
    told("crop", video("a.mp4", None, "--crop", "8", "4", "64", "48"), "the intrinsics follow", size(64, 48)),
    refused("crop outside", video("a.mp4", None, "--crop", "100", "4", "64", "48"), "leaves the pictures"),
    refused("--scale 0", twelve("--scale", "0"), "scale"),
    refused("--rate below 0", video("a.mp4", None, "--rate", "-5"), "rate"),
    refused("frames to drop beyond the end", twelve("--drop", "99"), "--drop '99': 99 is outside"),
    refused("camera, numbers with commas", twelve("--camera", "100,100,64,48"),
        "use a number, apart from the others: --camera 100 100 64 48"),
    *(refused(f"crop as {word}", twelve("--crop", word), f"--crop '{word}' is not allowed; use an integer, {how}") for
        word, how in (("100x80+10+12", "as X Y WIDTH HEIGHT: --crop 10 12 100 80"), ("10:12:100:80",
        "as X Y WIDTH HEIGHT"))),
    refused("rate with a decimal comma", twelve("--source-rate", "29,97"),
        "use a number, with a decimal point (29.97)"),
    refused("baseline with a unit", twelve("--baseline", "4.2 mm"), "use a number, without a unit (4.2)"),
    refused("frames in words", twelve("--frames", "first"), "'first': not a range"),
    *(refused(f"{word} of other programs", twelve(*word.split()), said) for word, said in (("--fps 10",
        "did you mean --rate or --source-rate?"), ("--resize 0.5", "did you mean --scale?"), ("-f",
        "did you mean --replace?"), ("--gpu", "the computation is on the CPU"), ("--input clip",
        "write SOURCE without an option"), ("--intrinsics k.txt", "did you mean --camera or --calibration?"))),
    refused("depth, relative inverse depth of 8 bits given as depth", given_inverse("depth"),
        "the frames are stretched to the full range; --kind relative reads"),
    told("depth, relative inverse depth of 8 bits, the remedy", given_inverse("relative"), "not metric"),
    refused("depth, relative inverse depth fitted to wrong depth", given_inverse("depth", "--trust-depth",
        then=("--kind", "relative", "--replace")), "may be the wrong one: prepare the clip again without depth"),
    refused("an option behind the dash of a text program", twelve("\N{EM DASH}scale", "0.5"), "did you mean --scale?"),
]  # fmt: skip
