"""How the inputs of `inputs_tried.py` are made, and how an outcome is checked."""

import shutil
import struct
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np
import public_layouts
from builders import builder
from depth_folders import true_depth
from made_videos import CAMERA, HEIGHT, WIDTH, files, picture, pictures, write
from PIL import Image
from scipy.spatial.transform import Rotation

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png
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


def prepare(name: str, *words: str, camera=CAMERA):
    return lambda folder: ["prepare", str(folder / name), "--out", str(folder / "o"), *camera, *words]


@builder
def video(folder: Path, name: str, frames=None, *words: str, change=lambda path: None, **how) -> list[str]:
    """A video as the input of `prepare`."""
    write(folder / name, pictures() if frames is None else frames, **how)
    change(folder / name)
    return prepare(name, *words)(folder)


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


def rewritten(folder: Path, change=lambda opened: opened, ending="png", **how) -> None:
    """Every picture of a folder again, changed by Pillow."""
    for file in sorted(folder.iterdir()):
        with Image.open(file) as opened:
            made = change(opened.copy())
        file.unlink()
        made.save(file.with_suffix(f".{ending}"), **how)


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


MATRIX = "100 0 63.5\n0 101 47.5\n0 0 1\n"


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


@cache
def moving_clip() -> tempfile.TemporaryDirectory:
    """A clip of a moving scope, which is simulated once."""
    kept = tempfile.TemporaryDirectory()
    size = ["--width", "160", "--height", "128", "--frames", "14"]
    assert main(["simulate", "moving-camera", "--out", f"{kept.name}/clip", *size, "-q"]) == 0
    return kept


def moving(folder: Path) -> None:
    """A copy of this clip; its poses stay in true.npy."""
    shutil.copytree(f"{moving_clip().name}/clip", folder / "clip")
    np.save(folder / "true.npy", np.load(folder / "clip/poses_bounds.npy")[:, :15])


def true_poses(folder: Path, kept: slice = slice(None), tolerance: float = 1e-4) -> bool:
    """The written poses are those of the kept frames of the clip."""
    written = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)[kept]
    turns = (true[:, :, :3] * [1.0, -1.0, -1.0]).transpose(0, 2, 1)
    shifts = -np.einsum("nij,nj->ni", turns, true[:, :, 3])
    return np.allclose(written, np.concatenate([turns, shifts[:, :, None]], axis=2), atol=tolerance)


TWICE = [picture(i // 2) for i in range(40)]
MOVED = [np.roll(shown, -5, axis=1) for shown in pictures()]


def matrices(folder: Path) -> np.ndarray:
    """The true camera-to-world matrices (n, 3, 4) of a clip of a moving scope."""
    moving(folder)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)
    return np.concatenate([true[:, :, :3] * [1.0, -1.0, -1.0], true[:, :, 3:4]], axis=2)


def lens_of(clip: Path) -> tuple[float, ...]:
    focal = float(np.load(clip / "poses_bounds.npy")[0, 14])
    return focal, focal, 80.0, 64.0


def squared(found: np.ndarray) -> np.ndarray:
    last = np.broadcast_to(np.array([[[0.0, 0, 0, 1]]]), (len(found), 1, 4))
    return np.concatenate([found, last], axis=1)


def quaternions(found: np.ndarray, order: str = "xyzw") -> np.ndarray:
    return Rotation.from_matrix(found[:, :, :3]).as_quat()[:, ["xyzw".index(axis) for axis in order]]


EUROC_HEAD = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m"
    " s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1],"
    " b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"
)
BEGIN, STEP = 1403636579763555584, 50_000_000  # nanoseconds: 20 pictures a second


def true_rig(folder: Path, kept: slice = slice(None), baseline: float = 0.0) -> bool:
    """The written cameras are the true ones, and so are intrinsics, times and baseline."""
    found = read_sequence_file(folder / "o")
    times = np.arange(14)[kept] * STEP / 1e9
    stated = np.array(found.times) if found.times else np.arange(found.frames) / found.frame_rate
    return (
        true_poses(folder, kept, 1e-3)
        and np.allclose([found.camera.fx, found.camera.cx, found.camera.cy], [142.4, 80, 64], atol=1e-3)
        and np.allclose(stated - stated[0], times - times[0], atol=1e-4)
        and np.isclose(found.camera.baseline, baseline, atol=1e-4)
    )


P = "{}: 100 0 63.5 {} 0 100 47.5 0 0 0 1 0\n"


@builder
def of_all_frames(folder: Path, planes, option: str, name=lambda k: f"{k}.png") -> list[str]:
    """One array for the clip, in the order of these names sorted as text."""
    files(folder, "clip", pictures())
    for k, file in enumerate(sorted((folder / "clip").iterdir())):
        file.rename(file.with_name(name(k)))
    np.save(folder / "a.npy", np.stack([planes(k) for k in sorted(range(12), key=name)]))
    return [*prepare("clip")(folder), option, str(folder / "a.npy")]


def exchanged_frames(frames: list) -> list:
    """Frames 6 and 7 in each other's place."""
    return [*frames[:6], frames[7], frames[6], *frames[8:]]


def slow(count: int = 16) -> list[np.ndarray]:
    return [picture(0.5 * i) for i in range(count)]


def exif(orientation: int = 1, space: int = 1) -> bytes:
    made = Image.Exif()
    made[0x0112] = orientation
    made.get_ifd(0x8769)[0xA001] = space
    return made.tobytes()


GROUPS = {"g": "12", "bf": "2"}  # options of the encoder: a whole picture in twelve


def hidden_lead_in(folder: Path) -> list[str]:
    """An mp4 whose edit list hides the first five pictures, as a cut without coding leaves it."""
    write(folder / "whole.mp4", pictures(24), options=GROUPS)
    how = {"avoid_negative_ts": "disabled"}
    with av.open(str(folder / "whole.mp4")) as whole, av.open(str(folder / "a.mp4"), "w", options=how) as out:
        source = whole.streams.video[0]
        stream = out.add_stream_from_template(source)
        for packet in whole.demux(source):
            if packet.size:
                lead = 5 * packet.duration
                packet.pts, packet.dts, packet.stream = packet.pts - lead, packet.dts - lead, stream
                out.mux(packet)
    return prepare("a.mp4")(folder)
