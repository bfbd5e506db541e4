"""Inputs as users have them, made up with real codecs, and what each command does with them.

    python tests/sequences/inputs_tried.py            the table in Markdown
    python tests/sequences/inputs_tried.py WORD       the rows whose kind holds the word

An outcome is `right` (the numbers that were written are those of the input), `told` (right, and a printed line names
what was done or assumed), `refused` (exit code 1 or 2 and one line), or `WRONG IN SILENCE`. `test_inputs_tried.py`
asserts every row.
"""

import contextlib
import io
import sys
import tempfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from common_folder import written
from made_videos import CAMERA, HEIGHT, INTERLACED, UNEVEN, WIDTH, picture, pictures, turn, woven, write
from raw_sources import colmap, stereomis
from test_stated_depth import WRONG as NO_LENGTHS
from test_stated_depth import recording as with_depth
from test_stated_depth import true_depth

from endotsr.cli.main import main
from endotsr.opencv import read_png, write_png
from endotsr.opencv.pictures import write_jpeg
from endotsr.sequences.sequence_file import FILE_NAME, read_sequence_file

WRONG = "WRONG IN SILENCE"
LONGEST = 200  # characters of a message in the table
NOT_HERE = {  # codecs that no package here encodes, so that no recording of them can be made
    "H.264 in separate field pictures (PAFF)": "the encoder x264 writes adaptive fields alone",
    "DV and DVCPRO": "their encoders take broadcast sizes alone",
    "DICOM and endoscope formats of a vendor": "no open encoder",
}


class Row(NamedTuple):
    """One kind of input."""

    kind: str
    make: Callable[[Path], list[str]]  # makes the input in a folder; the words of the command
    expected: str  # right, told or refused
    said: str = ""  # a part of what is printed
    check: Callable[[Path], bool] = lambda folder: True  # of what was written


class Outcome(NamedTuple):
    """What a command did."""

    row: Row
    command: str
    outcome: str
    message: str


def close(frames, tolerance=10.0):
    """The written pictures are these."""

    def check(folder: Path) -> bool:
        files = sorted((folder / "o/images").iterdir())
        apart = [np.abs(read_png(f).astype(int) - p.astype(int)).mean() for f, p in zip(files, frames, strict=True)]
        return max(apart) < tolerance

    return check


def timed(milliseconds):
    """The written times are these."""
    return lambda folder: np.allclose(
        read_sequence_file(folder / "o").times or [], np.array(milliseconds) / 1e3, atol=2e-3
    )


def size(width, height):
    """The written size is this, and so is that of the camera."""

    def check(folder: Path) -> bool:
        camera, seen = read_sequence_file(folder / "o").camera, read_png(folder / "o/images/000000.png")
        return (camera.width, camera.height) == (width, height) == (seen.shape[1], seen.shape[0])

    return check


def prepare(name: str, *words: str, camera=CAMERA):
    return lambda folder: ["prepare", str(folder / name), "--out", str(folder / "o"), *camera, *words]


def video(name: str, frames=None, *words: str, change=lambda path: None, **how):
    """A video as the input of `prepare`."""

    def make(folder: Path) -> list[str]:
        write(folder / name, pictures() if frames is None else frames, **how)
        change(folder / name)
        return prepare(name, *words)(folder)

    return make


def codec(kind: str, name: str, code: str, layout="yuv420p", **how) -> Row:
    return Row(f"video, {kind}", video(name, None, codec=code, layout=layout, **how), "right", "", close(pictures()))


def cut(part: float, whole=None):
    def change(path: Path) -> None:
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * part)])

    return change


def scratched(path: Path) -> None:
    """Bytes in the middle of the pictures are overwritten."""
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4000] = np.random.default_rng(0).integers(0, 256, 4000).astype(np.uint8).tobytes()
    path.write_bytes(data)


def files(folder: Path, name: str, frames, ending="png", start=0) -> None:
    (folder / name).mkdir()
    for i, frame in enumerate(frames):
        path = folder / name / f"{i + start:04d}.{ending}"
        write_png(path, frame) if ending == "png" else write_jpeg(path, frame)


def folder_of(frames, *words: str, ending="png", change=lambda folder: None):
    def make(folder: Path) -> list[str]:
        files(folder, "clip", frames, ending)
        change(folder)
        return prepare("clip", *words)(folder)

    return make


def masked(frames, *words: str, count=12):
    def change(folder: Path) -> None:
        files(folder, "m", frames[:count])

    def make(folder: Path) -> list[str]:
        return [*folder_of(pictures(), change=change)(folder), "--masks", str(folder / "m"), *words]

    return make


def mask(value=255):
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    plane[:, :40] = value
    return plane


def half_excluded(folder: Path) -> bool:
    return abs((read_png(folder / "o/masks/000003.png") > 0).mean() - 40 / WIDTH) < 0.01


def exif(folder: Path) -> None:
    from PIL import Image

    for file in (folder / "clip").iterdir():
        with Image.open(file) as opened:
            data = opened.getexif()
            data[0x0112] = 6
            opened.save(file, exif=data, quality=95)


def renamed(folder: Path) -> None:
    (folder / "clip/0005.png").rename(folder / "clip/0105.png")


def depth(values, *words, name="depth", kind="npy"):
    def make(folder: Path) -> list[str]:
        return [*with_depth(folder, values, name, kind), *words]

    return make


def depth_is_true(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return (
        entry is not None and np.abs(read_png(folder / "o/depth/000002.png") * entry.scale - true_depth(2)).max() < 0.03
    )


def one_camera(values, *words, points=0):
    """A clip from one camera with the files of a network, and true depth at some points beside it."""

    def make(folder: Path) -> list[str]:
        import test_relative_depth as one

        where, given = one.clip(folder, values)
        if points:
            one.sparse(where, points)
        return ["depth", str(where), "--given", str(given), "--kind", "relative", *words]

    return make


def common(*words: str, command="check", **changes):
    """A folder in the common format."""

    def make(folder: Path) -> list[str]:
        change = changes.pop("change", None)
        written(folder / "clip", **changes)
        if change:
            change(folder / "clip")
        return [command, str(folder / "clip"), *words]

    return make


def each(name, change):
    def done(clip: Path) -> None:
        for file in sorted((clip / name).iterdir()):
            write_png(file, change(read_png(file)))

    return done


def text(old, new):
    return lambda clip: (clip / FILE_NAME).write_text((clip / FILE_NAME).read_text().replace(old, new))


def frozen(clip: Path) -> None:
    first = read_png(clip / "images/000000.png")
    each("images", lambda x: first)(clip)


def stereomis_folder(*words, change=lambda raw: None):
    def make(folder: Path) -> list[str]:
        stereomis(folder / "raw")
        change(folder / "raw")
        return prepare("raw", *words, camera=())(folder)

    return make


def colmap_folder(*words):
    def make(folder: Path) -> list[str]:
        colmap(folder / "raw", False)
        return prepare("raw", *words, camera=())(folder)

    return make


def scope(folder: Path) -> list[str]:
    """A round field of view with an instrument, as a video."""
    from test_propose_masks import scene, through_a_scope

    write(folder / "a.mp4", through_a_scope(scene("pulling")[0])[0], options={"crf": "20"})
    return ["masks", str(folder / "a.mp4"), "--out", str(folder / "o")]


def view_is_kept(folder: Path) -> bool:
    return all(0.3 < (read_png(file) > 0).mean() < 0.8 for file in (folder / "o/masks").iterdir())


def exported(name: str, *words: str):
    def make(folder: Path) -> list[str]:
        sys.path.insert(0, str(Path(__file__).parents[1] / "export"))
        from made_up_model import moving_scene

        from endotsr.export.files import export

        export(moving_scene(), folder / "a.npz")
        return ["export", str(folder / "a.npz"), "--out", str(folder / name), *words]

    return make


def text_file(name: str, content: bytes):
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(content)
        return prepare(name)(folder)

    return make


def joined(folder: Path) -> list[str]:
    """A transport stream whose pictures change their size in the middle."""
    small = [picture(i, 96, 64) for i in range(6)]
    parts = [write(folder / f"{k}.ts", frames, "mpeg2video") for k, frames in enumerate((pictures(6), small))]
    (folder / "a.ts").write_bytes(b"".join(part.read_bytes() for part in parts))
    return prepare("a.ts")(folder)


def trailing(count):
    return lambda folder: read_sequence_file(folder / "o").frames == count


DEINTERLACED = [picture(2 * i) for i in range(12)]
STEREO = [np.hstack([p, p]) for p in pictures()]
ROWS = [
    codec("H.264, mp4", "a.mp4", "libx264"),
    codec("H.264, mkv", "a.mkv", "libx264"),
    codec("H.264, mov", "a.mov", "libx264"),
    codec("H.264, avi", "a.avi", "libx264", options={"bf": "0"}),
    codec("H.264, transport stream", "a.ts", "libx264"),
    codec("H.264, camera stream .mts", "a.m2ts", "libx264"),
    codec("H.264 4:2:2", "a.mp4", "libx264", "yuv422p"),
    codec("H.264 4:4:4", "a.mp4", "libx264", "yuv444p"),
    codec("H.264 10 bit", "a.mkv", "libx264", "yuv420p10le"),
    codec("H.264 full range", "a.mp4", "libx264", "yuvj420p"),
    codec("H.264 with B-frames", "a.mp4", "libx264", options={"bf": "3", "g": "12"}),
    codec("H.265, mp4", "a.mp4", "libx265"),
    codec("H.265 10 bit, mkv", "a.mkv", "libx265", "yuv420p10le"),
    codec("AV1, mkv", "a.mkv", "libsvtav1"),
    codec("AV1, mp4", "a.mp4", "libsvtav1"),
    codec("VP8, webm", "a.webm", "libvpx"),
    codec("VP9, webm", "a.webm", "libvpx-vp9"),
    codec("MPEG-1", "a.mpg", "mpeg1video", options={"b": "4000000"}),
    codec("MPEG-2, mpg", "a.mpg", "mpeg2video", options={"b": "4000000"}),
    codec("MPEG-2, transport stream", "a.ts", "mpeg2video", options={"b": "4000000"}),
    codec("MPEG-4 part 2, avi", "a.avi", "mpeg4", options={"b": "4000000"}),
    codec("WMV 8, wmv", "a.wmv", "wmv2", options={"b": "4000000"}),
    codec("Motion JPEG, avi", "a.avi", "mjpeg", "yuvj420p"),
    codec("Motion JPEG, mov", "a.mov", "mjpeg", "yuvj420p"),
    codec("ProRes, mov", "a.mov", "prores_ks", "yuv422p10le"),
    codec("FFV1, mkv", "a.mkv", "ffv1", "bgr0"),
    codec("PNG, mov", "a.mov", "png", "rgb24"),
    codec("HuffYUV, avi", "a.avi", "huffyuv", "rgb24"),
    codec("uncompressed, avi", "a.avi", "rawvideo", "bgr24"),
    *(
        Row(f"video, interlaced {kind}", video(name, woven(), codec=code, options=options), "told",
            "is interlaced: deinterlaced", close(DEINTERLACED))
        for kind, (name, code, options) in INTERLACED.items()
    ),
    *(
        Row(f"video, uneven times, {name[2:]}", video(name, None, codec=code, milliseconds=UNEVEN), "told",
            "not evenly spaced", timed(UNEVEN))
        for name, code in (("a.mkv", "libx264"), ("a.mp4", "libx264"), ("a.webm", "libvpx-vp9"))
    ),
    Row("video, uneven times, thinned by --rate", video("a.mkv", None, "--rate", "2", milliseconds=UNEVEN), "told",
        "by their times", close([picture(i) for i in (0, 4, 7)])),
    Row("video, uneven times, --source-rate", video("a.mkv", None, "--source-rate", "10", milliseconds=UNEVEN), "told",
        "10 a second", lambda folder: read_sequence_file(folder / "o").times is None),
    Row("video, 60 a second thinned to 20", video("a.mp4", None, "--rate", "20", rate=60), "told", "4 of 12 frames",
        close([picture(i) for i in (0, 3, 6, 9)])),
    Row("video, --rate above its own", video("a.mp4", None, "--rate", "50"), "refused", "the source has 25 frames"),
    *(
        Row(f"video, rotation of {degrees} degrees", video("a.mp4", change=lambda p, d=degrees: turn(p, d)), "refused",
            "--orientation turned")
        for degrees in (90, 180, 270)
    ),
    Row("video, rotation, --orientation turned", video("a.mp4", None, "--orientation", "turned",
        change=lambda p: turn(p, 90)), "told", "states a rotation", size(HEIGHT, WIDTH)),
    Row("video, rotation, --orientation stored", video("a.mp4", None, "--orientation", "stored",
        change=lambda p: turn(p, 90)), "told", "states a rotation", size(WIDTH, HEIGHT)),
    Row("video, pixels that are not square", video("a.mkv", shape=Fraction(16, 15)), "told", "times as wide as high"),
    Row("video, high dynamic range (PQ)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=16),
        "refused", "high dynamic range (PQ)"),
    Row("video, high dynamic range (HLG)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=18),
        "refused", "high dynamic range (HLG)"),
    Row("video, black", video("a.mp4", [picture(0) * 0] * 8), "refused", "8 of 8 frames are black"),
    Row("video, one colour", video("a.mp4", [picture(0) * 0 + np.uint8(90)] * 8), "refused", "of one colour"),
    Row("video, frozen", video("a.mp4", [picture(0)] * 8), "refused", "all 8 frames are one picture"),
    Row("video, a black second in it", video("a.mp4", [*pictures(9), *[picture(0) * 0] * 3]), "told", "black-frame"),
    Row("video, odd size", video("a.mkv", [picture(i, 127, 95) for i in range(12)], codec="ffv1", layout="bgr0"),
        "right", "", size(127, 95)),
    Row("video, one picture", video("a.mp4", pictures(1)), "right", "", trailing(1)),
    Row("video, truncated mp4, index at the end", video("a.mp4", change=cut(0.7)), "refused", "holds no pictures"),
    Row("video, truncated mp4, index in front", video("a.mp4", pictures(40), options={"bf": "0"},
        container={"movflags": "faststart"}, change=cut(0.7)), "refused", "truncated or damaged"),
    Row("video, damaged H.264", video("a.mp4", pictures(40), options={"qp": "4"}, change=scratched), "refused",
        "picture"),
    Row("video, size changes", joined, "refused", "allowed: one size"),
    Row("video, stereo, side by side", video("a.mp4", STEREO, "--stereo", "side_by_side", "--baseline", "4"), "right",
        "", close(pictures())),
    Row("video, stereo, of odd width", video("a.mkv", [p[:, :127] for p in pictures()], "--stereo", "side_by_side",
        "--baseline", "4", codec="ffv1", layout="bgr0"), "refused", "even width"),
    Row("text named .mp4", text_file("a.mp4", b"hello " * 99), "refused", "not a video by its first bytes"),
    Row("play list named .mp4", text_file("a.mp4", b"#EXTM3U\nfile:///etc/passwd\n"), "refused", "not a video by its"),
    Row("empty file named .mp4", text_file("a.mp4", b""), "refused", "not a video by its first bytes"),
    Row("pictures, png", folder_of(pictures()), "right", "", close(pictures(), 0.01)),
    Row("pictures, jpg", folder_of(pictures(), ending="jpg"), "right", "", close(pictures())),
    Row("pictures, jpg turned by EXIF", folder_of(pictures(), ending="jpg", change=exif), "refused", "orientation 6"),
    Row("pictures, interlaced", folder_of(woven()), "told", "interlaced-pictures"),
    Row("pictures, 16 bit", folder_of([p.astype(np.uint16) * 257 for p in pictures()]), "refused", "16-bit picture"),
    Row("pictures, grey", folder_of([p[..., 0] for p in pictures()]), "refused", "grey picture"),
    Row("pictures of two sizes", folder_of([*pictures(3), picture(3)[:80]]), "refused", "128x80 pixels, others 128x96"),
    Row("pictures, black", folder_of([picture(0) * 0] * 5), "refused", "5 of 5 frames are black"),
    Row("pictures, one under many names", folder_of([picture(0)] * 5), "refused", "all 5 frames are one picture"),
    Row("masks, right", masked([mask()] * 12), "right", "", half_excluded),
    Row("masks, one missing", masked([mask()] * 12, count=11), "refused", "1 of 12 frames have no mask"),
    Row("masks, missing, --gaps drop", masked([mask()] * 12, "--gaps", "drop", count=11), "told", "left out"),
    Row("masks, of other proportions", masked([mask()[:50]] * 12), "refused", "other proportions"),
    Row("masks, soft", masked([(mask() // 2 + np.arange(WIDTH)).astype(np.uint8)] * 12), "refused",
        "this is not a mask"),
    Row("depth, millimetres", depth(true_depth), "right", "", depth_is_true),
    Row("depth, metres, stated", depth(lambda i: true_depth(i) / 1e3, "--depth-unit", "m"), "right", "", depth_is_true),
    *(Row(f"depth, {kind}", depth(values, name=name, kind=ending), "refused", said)
      for kind, (values, name, ending, said) in NO_LENGTHS.items()),
    Row("depth, of half the size", depth(lambda i: true_depth(i)[::2, ::2]), "refused", "depth of 64x48 pixels"),
    Row("depth, not a number", depth(lambda i: true_depth(i) * np.nan), "refused", "no value is finite"),
    Row("one camera, relative depth, points to compare with",
        one_camera(lambda i: 1800 / true_depth(i) - 3, "--replace", points=60), "told",
        "scale and shift from the depth before", depth_is_true),
    Row("one camera, relative depth alone", one_camera(lambda i: 1800 / true_depth(i) - 3), "told",
        "not metric, scale and shift of the depth assumed"),
    Row("one camera, relative depth that grows with distance", one_camera(lambda i: true_depth(i) / 99), "refused",
        "near tissue is bright"),
    Row("one camera, no depth at all", video("a.mp4"), "told", "--kind relative"),
    Row("depth beside COLMAP", colmap_folder("--depth", "d"), "refused", "does not read --depth"),
    Row("StereoMIS, a mask missing, --gaps drop", stereomis_folder("--gaps", "drop",
        change=lambda raw: (raw / "masks/000002l.png").unlink()), "told", "not evenly spaced",
        timed((0, 40, 120, 160, 200))),
    Row("common format, masks inverted", common(change=each("masks", lambda x: 255 - x)), "refused",
        "set --sequence.excluded-value black"),
    Row("common format, masks inverted, the remedy", common("--sequence.excluded-value", "black",
        change=each("masks", lambda x: 255 - x)), "right", "can be trained on"),
    Row("common format, black pictures", common(change=each("images", lambda x: x * 0)), "refused", "no-picture"),
    Row("common format, one picture for ever", common(change=frozen), "refused", "constant-clip"),
    Row("common format, a mask over everything", common(change=lambda clip: write_png(clip / "masks/000002.png",
        np.full((24, 32), 255, np.uint8))), "told", "frame-without-tissue"),
    Row("common format, times that go back", common(times=[0.0, 0.1, 0.3, 0.2, 0.4]), "refused", "ascending seconds"),
    Row("common format, uneven times", common(times=[0.0, 0.1, 0.2, 0.9, 1.0]), "told", "uneven-times"),
    Row("masks of a round field of view", scope, "told", "field of view: ", view_is_kept),
    *(Row(f"export to {name}", exported(name, *words), "refused", "allowed: FILE.ply")
      for name, *words in (("a.spz",), ("a.splat",), ("a.obj", "--content", "mesh"), ("a.glb", "--content", "mesh"))),
]  # fmt: skip


def tried(row: Row, folder: Path) -> Outcome:
    """Make the input in an empty folder, run the command, and compare with what was expected."""
    words = row.make(folder)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    printed = out.getvalue() + err.getvalue()
    lines = [line.strip() for line in printed.replace(str(folder) + "/", "").splitlines() if line.strip()]
    named = next((line for line in lines if row.said and row.said in line), "")
    silent = row.expected == "refused" or (row.expected == "told" and not named)
    outcome = "refused" if code else WRONG if silent or not row.check(folder) else row.expected
    command = " ".join(["endotsr", *(word.replace(str(folder) + "/", "") for word in words)])
    return Outcome(row, command, outcome, named or (lines[-1] if lines else ""))


def table(word: str = "") -> str:
    """The rows whose kind holds the word, as Markdown."""
    lines, counts = ["| Input | Command | Outcome | Message |", "|---|---|---|---|"], {}
    for row in ROWS:
        if word in row.kind:
            with tempfile.TemporaryDirectory() as scratch:
                found = tried(row, Path(scratch))
            counts[found.outcome] = counts.get(found.outcome, 0) + 1
            message = found.message.replace("|", "/")[:LONGEST] if found.outcome != "right" else ""
            lines.append(f"| {row.kind} | `{found.command}` | {found.outcome} | {message} |")
    lines += [f"| {kind} | - | not tried | {why} |" for kind, why in NOT_HERE.items() if word in kind]
    total = ", ".join(f"{outcome}: {count}" for outcome, count in sorted(counts.items()))
    return "\n".join(
        [*lines, "", f"{sum(counts.values())} inputs; {total}; wrong in silence: {counts.get('WRONG IN SILENCE', 0)}"]
    )


if __name__ == "__main__":
    print(table(*sys.argv[1:2]))
