"""The training frames of a sequence at the working size of the tests.

In: a `Sequence`. Out: arrays of its m training frames; pictures wider than `WIDEST` are averaged over squares of
pixels. Held-out frames are never read. Noise, blur, smoke and highlights are measured at full size, and the test of the
camera reduces the pictures itself (`clips.poses.views`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera

WIDEST = 320  # columns of the working size
TILE = 16  # side of the tiles over which pixels are averaged, working pixels
TILE_TISSUE = 0.5  # minimum fraction of tissue pixels in a tile that counts
LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)


class ReducedFrames(NamedTuple):
    """m training frames at the working size h x w."""

    images: NDArray[np.float32]  # (m, 3, h, w) display units
    masks: BoolArray  # (m, h, w) True if all pixels of the square are tissue
    depth: NDArray[np.float32]  # (m, h, w) scene units, one sample of each square; 0 = no depth
    times: NDArray[np.float64]  # (m,) normalised, ascending
    cameras: list[Camera]  # m, at full size
    shrink: int  # side of the averaged squares, pixels of the full size
    frames: int  # of the whole sequence, including held-out frames
    reference: int  # the training frame with which the others are compared

    @property
    def count(self) -> int:
        """Number of training frames m."""
        return len(self.images)

    @property
    def luminance(self) -> NDArray[np.float32]:
        """(m, h, w) display units."""
        return np.einsum("c,mchw->mhw", LUMINANCE, self.images, optimize=True)


def reduced_frames(sequence: Sequence) -> ReducedFrames:
    """The training frames of a sequence, averaged to at most `WIDEST` columns. The middle one is the reference."""
    index, side = sequence.train_index, -(-sequence.width // WIDEST)
    height, width = sequence.height // side, sequence.width // side
    rows, columns = height * side, width * side
    images = np.empty((len(index), 3, height, width), np.float32)
    for k, i in enumerate(index):
        picture = sequence.images[i][:, :rows, :columns].reshape(3, height, side, width, side)
        images[k] = picture.mean(axis=(2, 4), dtype=np.float32) / np.float32(255)
    whole = sequence.masks[index][:, :rows, :columns].reshape(-1, height, side, width, side)
    masks = np.logical_and.reduce(whole, axis=(2, 4))
    depth = sequence.depth[index][:, side // 2 : rows : side, side // 2 : columns : side]
    cameras = [sequence.cameras[i] for i in index]
    return ReducedFrames(images, masks, depth, sequence.times[index], cameras, side, sequence.count, len(index) // 2)


def with_clear_reference(clip: ReducedFrames, clear: BoolArray) -> ReducedFrames:
    """The clip with the clear frame nearest the middle as its reference; unchanged if no frame is clear.

    clear   (m,) False for training frames with blur or smoke, or without tissue
    """
    frames = np.flatnonzero(clear)
    if not frames.size:
        return clip
    return clip._replace(reference=int(frames[np.abs(frames - clip.count // 2).argmin()]))


def tile_means(values: FloatArray, weights: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Mean of `values` (..., h, w) over the True pixels of `weights` (h, w) in each tile, and their number.

    returns  (..., T) means, NaN for a tile with a smaller fraction of them than `TILE_TISSUE`; (T,) counts
    """
    height, width = weights.shape
    rows, columns = height // TILE * TILE, width // TILE * TILE

    def totals(a: FloatArray) -> FloatArray:
        cut = a[..., :rows, :columns].reshape(*a.shape[:-2], rows // TILE, TILE, columns // TILE, TILE)
        return cut.sum(axis=(-3, -1), dtype=np.float64).reshape(*a.shape[:-2], -1)

    counts = totals(weights.astype(np.float64))
    sums = totals(np.where(weights, values, 0.0))
    enough = counts >= TILE_TISSUE * TILE * TILE
    return np.where(enough, sums / np.maximum(counts, 1.0), np.nan), counts


def without_gaps(values: FloatArray, times: FloatArray) -> FloatArray:
    """Values (m, ...) over time, with non-finite values interpolated in time."""
    out = values.copy()
    for column in out.reshape(len(times), -1).T:
        known = np.isfinite(column)
        column[~known] = np.interp(times[~known], times[known], column[known])
    return out


def slow_courses(times: FloatArray, count: int) -> FloatArray:
    """cos(pi k t) for k = 0 ... count - 1, one column each: (m, count). Column k has k half waves over the clip."""
    return np.cos(np.pi * np.arange(count) * times[:, None])


def residual(design: FloatArray, values: FloatArray) -> FloatArray:
    """Values (m,) or (m, n) less their least-squares fit by the columns of the design (m, k)."""
    return values - design @ np.linalg.lstsq(design, values, rcond=None)[0]


def tile_map(values: FloatArray, height: int, width: int) -> FloatArray:
    """Tile values (T,) as a picture (h, w); NaN beyond the last whole tile."""
    rows, columns = height // TILE, width // TILE
    picture = np.full((height, width), np.nan)
    picture[: rows * TILE, : columns * TILE] = np.kron(values.reshape(rows, columns), np.ones((TILE, TILE)))
    return picture
