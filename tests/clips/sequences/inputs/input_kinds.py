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
from builders import builder
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


@builder
def close(folder: Path, frames, tolerance=10.0) -> bool:
    """The written pictures are these."""
    files = sorted((folder / "o/images").iterdir())
    apart = [np.abs(read_png(f).astype(int) - p.astype(int)).mean() for f, p in zip(files, frames, strict=True)]
    return max(apart) < tolerance


def both(*checks):
    return lambda folder: all(check(folder) for check in checks)


def rated(rate: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, rate, rtol=1e-2)


def timed(milliseconds):
    """The written times are these."""
    return lambda folder: np.allclose(
        read_sequence_file(folder / "o").times or [], np.array(milliseconds) / 1e3, atol=2e-3
    )


@builder
def size(folder: Path, width, height) -> bool:
    """The written size is this, and so is that of the camera."""
    camera, seen = read_sequence_file(folder / "o").camera, read_png(folder / "o/images/000000.png")
    return (camera.width, camera.height) == (width, height) == (seen.shape[1], seen.shape[0])


def baseline(millimetres: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").camera.baseline, millimetres, atol=1e-4)


@builder
def sides(folder: Path, left, right, tolerance=12.0) -> bool:
    """The written pairs are these."""
    clip = describe(folder / "o")
    return clip.count == len(left) == len(right) and all(
        np.abs(pair.left.astype(int) - one).mean() <= tolerance
        and np.abs(pair.right.astype(int) - other).mean() <= tolerance
        for pair, one, other in zip(clip.pictures(list(range(clip.count))), left, right)
    )


def prepare(name: str, *words: str, camera=CAMERA):
    return lambda folder: ["prepare", str(folder / name), "--out", str(folder / "o"), *camera, *words]


@builder
def video(folder: Path, name: str, frames=None, *words: str, change=lambda path: None, **how) -> list[str]:
    """A video as the input of `prepare`."""
    write(folder / name, pictures() if frames is None else frames, **how)
    change(folder / name)
    return prepare(name, *words)(folder)


def codec(kind: str, name: str, code: str, layout="yuv420p", **how) -> Row:
    return Row(f"video, {kind}", video(name, None, codec=code, layout=layout, **how), "right", "", close(pictures()))


@builder
def cut(path: Path, part: float, whole=None) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * part)])


@builder
def folder_of(folder: Path, frames, *words: str, ending="png", change=lambda folder: None) -> list[str]:
    files(folder, "clip", frames, ending)
    change(folder)
    return prepare("clip", *words)(folder)


@builder
def pair(folder: Path, *words: str, names=("left", "right"), frames=None, change=lambda clip: None) -> list[str]:
    """The pictures of two cameras in two folders."""
    for name, shown in zip(names, frames or (pictures(), pictures())):
        files(folder / "clip", name, shown)
    change(folder / "clip")
    return prepare("clip", "--baseline", "4", *words)(folder)


def named(name, frames=None):
    """The pictures under other names, by their number."""

    def change(folder: Path) -> None:
        for k, file in enumerate(sorted((folder / "clip").iterdir())):
            file.rename(file.with_name(name(k)))

    return folder_of(frames or pictures(), change=change)


@builder
def trajectory(folder: Path, lines: list[str] | bytes, *words: str) -> list[str]:
    """Pictures with a trajectory in a text file."""
    (folder / "t.txt").write_bytes(lines if isinstance(lines, bytes) else "\n".join(lines).encode())
    return folder_of(pictures(), "--trajectory", str(folder / "t.txt"), *words)(folder)


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


@builder
def shortened(folder: Path, ending: str) -> None:
    """The last twentieth of the fourth file is missing."""
    converted(ending)(folder)
    cut(0.95)(folder / f"clip/0003.{ending}")


def every_second_jpg(folder: Path) -> None:
    for file in sorted((folder / "clip").iterdir())[::2]:
        pixels = read_png(file)
        file.unlink()
        write_jpeg(file.with_suffix(".jpg"), pixels)


@builder
def depth(folder: Path, values, *words, name="depth", kind="npy") -> list[str]:
    return [*with_depth(folder, values, name, kind), *words]


@builder
def depth_files(folder: Path, save, ending: str, *words: str) -> list[str]:
    """True depth in files of another kind; `save` gets the path and the plane of a frame."""
    found = with_depth(folder, true_depth)
    for i, file in enumerate(sorted((folder / "depth").iterdir())):
        file.unlink()
        save(file.with_suffix(ending), true_depth(i))
    return [*found, *words]


def depth_is_true(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return (
        entry is not None and np.abs(read_png(folder / "o/depth/000002.png") * entry.scale - true_depth(2)).max() < 0.03
    )


@builder
def raw(folder: Path, write_raw, *words: str, change=lambda folder: None, camera=()) -> list[str]:
    """A folder of another program in raw/, changed."""
    write_raw(folder / "raw")
    change(folder / "raw")
    return prepare("raw", *words, camera=camera)(folder)


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


@builder
def calibrated(folder: Path, name: str, text: str, *words: str, folders=()) -> list[str]:
    """Pictures in clip/, or in these folders of it, with a calibration of another program."""
    for place in folders or (".",):
        files(folder / "clip", place, pictures())
    (folder / name).write_text(text)
    return prepare("clip", "--calibration", str(folder / name), *words, camera=())(folder)


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


@builder
def common(folder: Path, *words: str, command="check", change=lambda clip: None, **changes) -> list[str]:
    """A folder in the common format."""
    written(folder / "clip", **changes)
    change(folder / "clip")
    return [command, str(folder / "clip"), *words]


@builder
def with_files(folder: Path, *names: str) -> None:
    """Further files in a folder."""
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("1")


@builder
def reworded(folder: Path, name: str, change) -> None:
    """A text file of a folder, changed."""
    (folder / name).write_text(change((folder / name).read_text()))


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


@builder
def each(clip: Path, name, change) -> None:
    for file in sorted((clip / name).iterdir()):
        write_png(file, change(read_png(file)))
