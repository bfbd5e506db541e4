"""How the inputs of `inputs_tried.py` are made, and how an outcome is checked."""

import json
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[3]))
import public_layouts
import raw_sources
from calibration_files import kalibr, ros
from common_folder import written
from depth_folders import recording as with_depth
from depth_folders import true_depth
from made_videos import CAMERA, HEIGHT, WIDTH, files, pictures, write
from public_layouts import K

from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.sequence_file import read_sequence_file


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


def both(*checks):
    return lambda folder: all(check(folder) for check in checks)


def rated(rate: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, rate, rtol=1e-2)


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


def baseline(millimetres: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").camera.baseline, millimetres, atol=1e-4)


def sides(left, right, tolerance=12.0):
    """The written pairs are these."""

    def check(folder: Path) -> bool:
        clip = describe(folder / "o")
        return clip.count == len(left) == len(right) and all(
            np.abs(pair.left.astype(int) - one).mean() <= tolerance
            and np.abs(pair.right.astype(int) - other).mean() <= tolerance
            for pair, one, other in zip(clip.pictures(list(range(clip.count))), left, right)
        )

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


def folder_of(frames, *words: str, ending="png", change=lambda folder: None):
    def make(folder: Path) -> list[str]:
        files(folder, "clip", frames, ending)
        change(folder)
        return prepare("clip", *words)(folder)

    return make


def pair(*words: str, names=("left", "right"), frames=None, change=lambda clip: None):
    """The pictures of two cameras in two folders."""

    def make(folder: Path) -> list[str]:
        for name, shown in zip(names, frames or (pictures(), pictures())):
            files(folder / "clip", name, shown)
        change(folder / "clip")
        return prepare("clip", "--baseline", "4", *words)(folder)

    return make


def named(name, frames=None):
    """The pictures under other names, by their number."""

    def change(folder: Path) -> None:
        for k, file in enumerate(sorted((folder / "clip").iterdir())):
            file.rename(file.with_name(name(k)))

    return folder_of(frames or pictures(), change=change)


def trajectory(lines: list[str] | bytes, *words: str):
    """Pictures with a trajectory in a text file."""

    def make(folder: Path) -> list[str]:
        (folder / "t.txt").write_bytes(lines if isinstance(lines, bytes) else "\n".join(lines).encode())
        return folder_of(pictures(), "--trajectory", str(folder / "t.txt"), *words)(folder)

    return make


def masked(frames, *words: str, count=12, change=lambda folder: None):
    changed = change

    def change(folder: Path) -> None:
        files(folder, "m", frames[:count])
        changed(folder / "m")

    def make(folder: Path) -> list[str]:
        return [*folder_of(pictures(), change=change)(folder), "--masks", str(folder / "m"), *words]

    return make


def mask(value=255):
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    plane[:, :40] = value
    return plane


def half_excluded(folder: Path) -> bool:
    return abs((read_png(folder / "o/masks/000003.png") > 0).mean() - 40 / WIDTH) < 0.01


def rewritten(folder: Path, change=lambda opened: opened, ending="png", **how) -> None:
    """Every picture of a folder again, changed by Pillow."""
    for file in sorted(folder.iterdir()):
        with Image.open(file) as opened:
            made = change(opened.copy())
        file.unlink()
        made.save(file.with_suffix(f".{ending}"), **how)


def converted(ending: str, change=lambda opened: opened, **how):
    return lambda folder: rewritten(folder / "clip", change, ending, **how)


def exif(orientation: int = 1, space: int = 1) -> bytes:
    made = Image.Exif()
    made[0x0112] = orientation
    made.get_ifd(0x8769)[0xA001] = space
    return made.tobytes()


def transparent(columns: int):
    """The first columns of the pictures are transparent."""

    def changed(opened):
        alpha = np.full(opened.size[::-1], 255, np.uint8)
        alpha[:, :columns] = 0
        opened.putalpha(Image.fromarray(alpha))
        return opened

    return converted("png", changed)


def as_transparency(folder: Path) -> None:
    """Masks as drawing programs write them: black, and transparent where nothing is marked."""

    def changed(opened):
        black = Image.new("RGB", opened.size)
        black.putalpha(opened)
        return black

    rewritten(folder, changed)


def labels(*colour: int):
    """Masks with a palette in which 1 has this colour, as tools that annotate instruments store them."""

    def changed(opened):
        made = opened.point(lambda value: value // 255).convert("P")
        made.putpalette([0, 0, 0, *colour])
        return made

    return lambda folder: rewritten(folder, changed)


def blank():
    return Image.new("RGB", (WIDTH, HEIGHT))


def shortened(ending: str):
    """The last twentieth of the fourth file is missing."""

    def change(folder: Path) -> None:
        converted(ending)(folder)
        cut(0.95)(folder / f"clip/0003.{ending}")

    return change


def every_second_jpg(folder: Path) -> None:
    for file in sorted((folder / "clip").iterdir())[::2]:
        pixels = read_png(file)
        file.unlink()
        write_jpeg(file.with_suffix(".jpg"), pixels)


def depth(values, *words, name="depth", kind="npy"):
    def make(folder: Path) -> list[str]:
        return [*with_depth(folder, values, name, kind), *words]

    return make


def depth_files(save, ending: str, *words: str):
    """True depth in files of another kind; `save` gets the path and the plane of a frame."""

    def make(folder: Path) -> list[str]:
        found = with_depth(folder, true_depth)
        for i, file in enumerate(sorted((folder / "depth").iterdir())):
            file.unlink()
            save(file.with_suffix(ending), true_depth(i))
        return [*found, *words]

    return make


def depth_is_true(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return (
        entry is not None and np.abs(read_png(folder / "o/depth/000002.png") * entry.scale - true_depth(2)).max() < 0.03
    )


def raw(write_raw, *words: str, change=lambda folder: None, camera=()):
    """A folder of another program in raw/, changed."""

    def make(folder: Path) -> list[str]:
        write_raw(folder / "raw")
        change(folder / "raw")
        return prepare("raw", *words, camera=camera)(folder)

    return make


def public(layout: str, *words: str, change=lambda folder: None, **how):
    """A public layout; see `public_layouts`."""
    return raw(lambda folder: getattr(public_layouts, layout)(folder, **how), *words, change=change)


def colmap(*words: str, binary: bool = False, frames: int = 6, change=lambda folder: None):
    """A COLMAP model."""
    return raw(lambda folder: raw_sources.colmap(folder, binary, frames), *words, change=change)


def centred(folder: Path) -> bool:
    """The written principal point is the middle of the picture: half a pixel was added once."""
    camera = read_sequence_file(folder / "o").camera
    return abs(camera.cx - WIDTH / 2) < 1e-3 and abs(camera.cy - HEIGHT / 2) < 1e-3


def calibrated(name: str, text: str, *words: str, folders=()):
    """Pictures in clip/, or in these folders of it, with a calibration of another program."""

    def make(folder: Path) -> list[str]:
        for place in folders or (".",):
            files(folder / "clip", place, pictures())
        (folder / name).write_text(text)
        return prepare("clip", "--calibration", str(folder / name), *words, camera=())(folder)

    return make


def ros_text(**changes) -> str:
    return ros(K, [0.0] * 5, **changes)


def kalibr_text(**changes) -> str:
    return kalibr(pair=False, distortion_coeffs=[0.0] * 4, **changes)


MATRIX = "100 0 63.5\n0 101 47.5\n0 0 1\n"
OPENCV = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [100., 0., 63.5, 0., 101., 47.5, 0., 0., 1.]
"""


def common(*words: str, command="check", change=lambda clip: None, **changes):
    """A folder in the common format."""

    def make(folder: Path) -> list[str]:
        written(folder / "clip", **changes)
        change(folder / "clip")
        return [command, str(folder / "clip"), *words]

    return make


def with_files(*names: str):
    """Further files in a folder."""

    def change(folder: Path) -> None:
        for name in names:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text("1")

    return change


def reworded(name: str, change):
    """A text file of a folder, changed."""

    def done(folder: Path) -> None:
        (folder / name).write_text(change((folder / name).read_text()))

    return done


def first_to_last(first: int, last: int | None = None, step: int = 1):
    """Some of the lines of a text."""
    return lambda text: "\n".join(text.splitlines()[first:last:step]) + "\n"


def frames_changed(**changes):
    """Every entry of the frames of transforms.json, with keys that are computed from it or added."""

    def entry(frame):
        return frame | {key: value(frame) if callable(value) else value for key, value in changes.items()}

    def change(text: str) -> str:
        data = json.loads(text)
        return json.dumps(data | {"frames": [entry(frame) for frame in data["frames"]]})

    return reworded("transforms.json", change)


def tiff(path: Path, plane: np.ndarray, black_is_zero: int = 1, bits: int = 16, sign: int = 1) -> None:
    """A TIFF written by hand, with 0 as white if `black_is_zero` is 0; `sign`: 2 signed, 3 real numbers."""
    height, width = plane.shape
    data = np.packbits(plane, axis=1).tobytes() if bits == 1 else plane.astype(f"<u{bits // 8}").tobytes()
    tags = [(256, 4, width), (257, 4, height), (258, 3, bits), (259, 3, 1), (262, 3, black_is_zero), (273, 4, 8),
            (277, 3, 1), (278, 4, height), (279, 4, len(data)), (339, 3, sign)]  # fmt: skip
    directory = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    path.write_bytes(
        b"II*\0" + struct.pack("<I", 8 + len(data)) + data + struct.pack("<H", len(tags)) + directory + bytes(4)
    )


def each(name, change):
    def done(clip: Path) -> None:
        for file in sorted((clip / name).iterdir()):
            write_png(file, change(read_png(file)))

    return done
