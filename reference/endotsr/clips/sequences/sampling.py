"""A part of a clip in place of all of it: some frames, some rows and columns, a smaller picture; and runs of frames."""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import area_resize
from endotsr.method.kernels.arrays import BoolArray

SMALL = 8  # pixels between the rows and columns of a small picture


def even_frames(count: int, most: int) -> list[int]:
    """`most` evenly spaced frames of `count`, the first and the last one included; one frame is the middle one.

    Edges:   all frames if there are at most `most`.
    """
    if most == 1:
        return [count // 2]
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int)).tolist()


def runs_of(flags: BoolArray) -> list[tuple[int, int]]:
    """Begin and end of every run of True in (n,), ascending; the end is the first index after the run."""
    bounds = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0)).tolist()
    return list(zip(bounds[::2], bounds[1::2]))


def longest_run(flags: BoolArray) -> tuple[int, int]:
    """As `runs_of`, the first of the longest runs; (0, 0) without one."""
    return max(runs_of(flags), key=lambda run: run[1] - run[0], default=(0, 0))


def sparse_step(height: int) -> int:
    """The step between sampled rows and columns that leaves 128 to 255 rows of a picture with so many or more."""
    return max(1, height // 128)


def small_picture(picture: NDArray[np.uint8]) -> NDArray[np.int16]:
    """Every eighth pixel (h, w, 3) of a picture (H, W, 3); of one below 64 pixels, every second or each."""
    step = sampling_step(picture)
    return picture[::step, ::step].astype(np.int16)


def sampling_step(picture: NDArray[np.uint8]) -> int:
    """Pixels between the rows and columns of a small picture."""
    return max(1, min(SMALL, min(picture.shape[:2]) // 8))


def reduced_to(picture: NDArray[np.uint8], longest: int) -> NDArray[np.uint8]:
    """The picture (H, W, 3) with its longer side reduced to `longest` pixels; a smaller one unchanged."""
    height, width = picture.shape[:2]
    factor = min(1.0, longest / max(height, width))
    return area_resize(picture, max(1, round(width * factor)), max(1, round(height * factor)))
