"""What a row of `inputs_tried.py` is, and how its outcome is checked."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from builders import builder
from depth_folders import true_depth
from made_videos import HEIGHT, WIDTH, pictures

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


class Row(NamedTuple):
    """One kind of input."""

    kind: str
    make: Callable[[Path], list[str]]  # makes the input in a folder; the words of the command
    expected: str  # right, told or refused
    said: str = ""  # a part of what is printed
    check: Callable[[Path], bool] = lambda folder: True  # of what was written


def right(kind: str, make, check=lambda folder: True) -> Row:
    return Row(kind, make, "right", "", check)


def told(kind: str, make, said: str, check=lambda folder: True) -> Row:
    return Row(kind, make, "told", said, check)


def refused(kind: str, make, said: str) -> Row:
    return Row(kind, make, "refused", said)


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


ALIKE, EXACT = close(pictures()), close(pictures(), 0.01)  # the twelve usual pictures


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


def depth_is_true(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return (
        entry is not None and np.abs(read_png(folder / "o/depth/000002.png") * entry.scale - true_depth(2)).max() < 0.03
    )


def centred(folder: Path) -> bool:
    """The written principal point is the middle of the picture: half a pixel was added once."""
    camera = read_sequence_file(folder / "o").camera
    return abs(camera.cx - WIDTH / 2) < 1e-3 and abs(camera.cy - HEIGHT / 2) < 1e-3


def true_poses(folder: Path, kept: slice = slice(None), tolerance: float = 1e-4) -> bool:
    """The written poses are those of the kept frames of the clip."""
    written = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)[kept]
    turns = (true[:, :, :3] * [1.0, -1.0, -1.0]).transpose(0, 2, 1)
    shifts = -np.einsum("nij,nj->ni", turns, true[:, :, 3])
    return np.allclose(written, np.concatenate([turns, shifts[:, :, None]], axis=2), atol=tolerance)


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
