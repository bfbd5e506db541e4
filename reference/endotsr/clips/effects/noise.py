"""The noise level, which the tests of blur, smoke, motion, rate, light and topology use.

There are two estimates, and each is an upper limit: differences over time include motion, and differences over the
picture include texture. The smaller one is used. Both are medians, which suppresses moving edges and vessels.
Compression that smooths a frame lowers both the noise and the estimate over the picture.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.effects.frames import TILE, ReducedFrames
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray

NORMAL_MAD = 0.6745  # median of |x| of a standard normal
QUANTISATION = 1.0 / 255.0 / 12.0**0.5  # standard deviation of the rounding to 8 bits, display units
QUARTILE = 25  # percentile of the tiles, taken as free of texture
LEAST_PIXELS = 64  # of tissue in a tile
MOST_FRAMES = 12  # frames of the spatial estimate, enough for its median


class Noise(NamedTuple):
    """Standard deviation of the noise per channel, display units."""

    full: FloatArray  # (3,) per pixel at full size
    working: FloatArray  # (3,) per pixel at working size
    source: str  # "differences over time" or "differences over the picture", whichever is smaller

    @property
    def level(self) -> float:
        """Mean over the channels at full size."""
        return float(self.full.mean())


def estimate_noise(sequence: Sequence, clip: ReducedFrames) -> Noise:
    """The noise of the training frames at full and at working size."""
    chosen = even_frames(clip.count, MOST_FRAMES)
    index = sequence.train_index[chosen]
    full = [spatial_noise(sequence.images[i] / 255.0, sequence.masks[i]) for i in index]
    working = [spatial_noise(clip.images[k], clip.masks[k]) for k in chosen]
    temporal = temporal_noise(clip)
    by_picture, by_size = _median(working), _median(full)
    source = "differences over time" if temporal.mean() < by_picture.mean() else "differences over the picture"
    # averaging over squares divides independent noise by their side
    upper = np.minimum(by_size, temporal * clip.shrink)
    lowest = QUANTISATION / clip.shrink
    return Noise(np.maximum(upper, QUANTISATION), np.maximum(np.minimum(by_picture, temporal), lowest), source)


def _median(rows: list[FloatArray]) -> FloatArray:
    with np.errstate(all="ignore"):
        found = np.nanmedian(np.array(rows), axis=0) if np.isfinite(rows).any() else np.full(3, QUANTISATION)
    return np.nan_to_num(found, nan=QUANTISATION)


def temporal_noise(clip: ReducedFrames) -> FloatArray:
    """MAD(x[t-1] - 2 x[t] + x[t+1]) / (0.6745 sqrt 6) over tissue, per channel (3,); inf without equal time steps."""
    steps = np.diff(clip.times)
    found = []
    for k in range(1, clip.count - 1):
        if abs(steps[k] - steps[k - 1]) < 1e-9:
            common = clip.masks[k - 1] & clip.masks[k] & clip.masks[k + 1]
            if common.any():
                second = clip.images[k - 1] - 2 * clip.images[k] + clip.images[k + 1]
                found.append(np.median(np.abs(second[:, common]), axis=1) / (NORMAL_MAD * 6**0.5))
    return np.median(found, axis=0) if found else np.full(3, np.inf)


def spatial_noise(image: FloatArray, mask: BoolArray) -> FloatArray:
    """MAD of the product of two second differences, (1 -2 1) down and across, over its norm 6; (3,), NaN off tissue.

    Linear ramps and axis-aligned edges cancel (Immerkaer 1996). The estimate is the lower quartile over the tiles of
    the median in each tile: most tiles contain texture, but seldom all.
    """
    down = image[:, :-2] - 2 * image[:, 1:-1] + image[:, 2:]
    both = np.abs(down[:, :, :-2] - 2 * down[:, :, 1:-1] + down[:, :, 2:])
    inner = mask[1:-1, 1:-1] & mask[:-2, :-2] & mask[2:, 2:] & mask[:-2, 2:] & mask[2:, :-2]
    rows, columns = inner.shape
    found = [
        np.median(both[:, y : y + TILE, x : x + TILE][:, inner[y : y + TILE, x : x + TILE]], axis=1)
        for y in range(0, rows, TILE)
        for x in range(0, columns, TILE)
        if inner[y : y + TILE, x : x + TILE].sum() >= LEAST_PIXELS
    ]
    return np.percentile(found, QUARTILE, axis=0) / (NORMAL_MAD * 6.0) if found else np.full(3, np.nan)
