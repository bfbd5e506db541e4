"""Depth that is stored upside down or mirrored relative to its picture.

In: the picture, depth and tissue of sampled frames, and the disparity of a stereo pair, if there is one. Out: findings.
The light is on the scope: brightness decreases with depth, and the gradients of brightness and depth oppose each other.
They do so only in the correct orientation of the depth. Where single frames have another orientation, their depth
resembles that of the frame before after a flip, and not as stored.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.checks.masks import smaller_part
from endotsr.method.kernels.arrays import Array
from endotsr.untrusted.names import counted

FLIPS = {"upside down": (0,), "mirrored": (1,), "turned by half a turn": (0, 1)}  # axes of a plane (H, W)
CELLS = 48  # along the shorter side of a picture; cell means are compared
LIT = (8.0, 250.0)  # grey levels that are neither black nor overexposed
FEWEST = 100  # cells of a comparison
LEAST, GAIN = 0.3, 0.2  # of the shading fit; right clips have 0.55 to 0.69 as stored, and at most 0.21 flipped
FITS, BETTER = 0.8, 0.1  # correlation with a stereo pair, and gain; right clips have 0.90 to 0.98
INVERTED = -0.5
NARROW = 128  # px
SAME, TURNED = 0.8, 0.3  # correlation of a flipped depth with that of the frame before, and gain over it as stored


class Fit(NamedTuple):
    """The fit of a depth as stored, and of its flips in the order of `FLIPS`."""

    stored: float
    flipped: tuple[float, ...]

    @property
    def best(self) -> tuple[str, float]:
        """The best-fitting flip, and its fit."""
        k = int(np.argmax(self.flipped))
        return list(FLIPS)[k], self.flipped[k]


def shading_fit(picture: NDArray[np.uint8], depth: NDArray[np.float32], tissue: NDArray[np.bool_] | None) -> Fit | None:
    """How strongly the gradients of brightness and depth oppose each other, in [-1, 1]; None for too few cells.

    picture (H, W, 3), depth (H, W), 0 = none; tissue (H, W) or None. With the gradients g of the logarithms of cell
    means: -sum g_picture . g_depth / sum |g_picture| |g_depth|.
    """
    grey = picture.mean(axis=2, dtype=np.float32)
    usable = (grey > LIT[0]) & (grey < LIT[1])
    bright = _slopes(_cells(grey, usable if tissue is None else usable & tissue))
    cells = _cells(depth, depth > 0)
    fits = []
    for axes in ((), *FLIPS.values()):
        far = _slopes(np.flip(cells, axes))
        both = np.isfinite(bright).all(axis=0) & np.isfinite(far).all(axis=0)
        a, b = bright[:, both], far[:, both]
        lengths = float((np.hypot(*a) * np.hypot(*b)).sum())
        if both.sum() < FEWEST or lengths == 0:
            return None
        fits.append(-float((a * b).sum()) / lengths)
    return Fit(fits[0], tuple(fits[1:]))


def _cells(plane: Array, usable: NDArray[np.bool_]) -> Array:
    """Logarithm of the means over square cells; NaN for a cell with an unusable pixel."""
    step = max(1, round(min(plane.shape) / CELLS))
    height, width = (side // step for side in plane.shape)
    kept = np.where(usable, plane, np.nan)[: height * step, : width * step]
    return np.log(kept.reshape(height, step, width, step).mean(axis=(1, 3)))


def _slopes(cells: Array) -> Array:
    if min(cells.shape) < 2:
        return np.full((2, *cells.shape), np.nan)
    down, across = np.gradient(cells)
    return np.stack([down, across])


def shading_finding(fits: list[Fit], where: str) -> list[Finding]:
    """A warning if a flip of the depth fits the light better than the depth as stored."""
    if not fits:
        return []
    stored, *flipped = np.median([(fit.stored, *fit.flipped) for fit in fits], axis=0).tolist()
    usual = Fit(stored, tuple(flipped))
    flip, value = usual.best
    if value < LEAST or value - abs(usual.stored) < GAIN:  # an inverse depth also has opposite gradients
        return []
    what = f"over {len(fits)} frames the depth fits the light {flip} ({value:.2f}; as stored {usual.stored:.2f})"
    return [finding("flipped-depth", where, what)]


class DepthTurns:
    """The frames at which the orientation of the depth changes, from one pass over it in time order."""

    def __init__(self) -> None:
        self._turns: list[tuple[int, str]] = []  # frame and flip
        self._last: Array | None = None  # cells of the frame before, or of the last one with depth
        self._count = 0

    def add(self, frame: int, depth: NDArray[np.float32] | None) -> None:
        """The depth of a frame, (H, W), 0 = none; None where there is none."""
        cells = None if depth is None or not depth.any() else _cells(depth, depth > 0)
        if cells is not None:
            if self._last is not None and self._last.shape == cells.shape:
                fits = {flip: _alike(np.flip(cells, axes), self._last) for flip, axes in FLIPS.items()}
                flip = max(fits, key=lambda name: fits[name])
                if fits[flip] > SAME and fits[flip] - _alike(cells, self._last) > TURNED:
                    self._turns.append((frame, flip))
            self._last = cells
        self._count = frame + 1

    def findings(self, where: str) -> list[Finding]:
        """A warning on the frames whose depth has another orientation than most."""
        turned = smaller_part([frame for frame, _ in self._turns], self._count)
        if not turned:
            return []
        flip, first = self._turns[0][1], turned[0]
        what = f"the depth of {counted(len(turned), 'frame')} is {flip} in comparison with its neighbours"
        return [finding("flipped-depth", where, f"{what}: {shortened([str(i) for i in turned])}", first)]


def _alike(one: Array, other: Array) -> float:
    """The correlation of cells where both have depth; 0 for too few."""
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < FEWEST or min(np.ptp(one[both]), np.ptp(other[both])) == 0:
        return 0.0
    return float(np.corrcoef(one[both], other[both])[0, 1])


def agreed_disparity(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32] | None:
    """Disparity (H, W) of a pair, px; NaN where matching from left and right disagrees; None for narrow pictures."""
    from endotsr.clips.opencv.stereo import match_pair

    if left.shape[1] <= NARROW:
        return None
    match = match_pair(left, right, 0, 64, smooth=False)
    return np.where(match.disagreement <= 1, match.raw, np.float32(np.nan))


def pair_finding(
    left: NDArray[np.uint8], right: NDArray[np.uint8], depth: Array, where: str, frame: int
) -> list[Finding]:
    """`stereo_finding` for the disparity of a pair (H, W, 3); none for narrow pictures."""
    disparity = agreed_disparity(left, right)
    return [] if disparity is None else stereo_finding(depth, disparity, where, frame)


def stereo_finding(depth: Array, disparity: Array, where: str, frame: int) -> list[Finding]:
    """A finding if depth increases with the disparity (H, W) of the stereo pair, or fits it after a flip.

    disparity   pixels, NaN where unknown
    """
    fits = [_correlation(np.flip(depth, axes), disparity) for axes in ((), *FLIPS.values())]
    fit = Fit(fits[0], tuple(fits[1:]))
    flip, value = fit.best
    if value >= FITS and value - fit.stored >= BETTER and value > -fit.stored:
        what = f"the depth fits the stereo pair {flip} ({value:.2f}; as stored {fit.stored:.2f})"
        return [finding("flipped-depth", where, what, frame)]
    if fit.stored <= INVERTED:
        what = f"depth decreases where the stereo pair is farther (correlation {fit.stored:.2f})"
        return [finding("inverted-depth", where, what, frame)]
    return []


def _correlation(depth: Array, disparity: Array) -> float:
    """The correlation of depth with the inverse disparity; 0 for too few pixels."""
    both = (depth > 0) & np.isfinite(disparity) & (disparity > 0)
    if both.sum() < 500 or np.ptp(depth[both]) == 0:
        return 0.0
    return float(np.corrcoef(depth[both], 1.0 / disparity[both])[0, 1])
