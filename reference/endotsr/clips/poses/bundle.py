"""Direct bundle adjustment: all poses at once from the residuals (B19) of pairs of frames, with depth held fixed.

In: poses near the solution, and the levels of a pyramid from coarse to fine. Out: the refined poses. A step is taken
only if the cost falls. Every pair has its own robust scale, held fixed while steps are tried. Pairs of frames that see
one place at different times (`returns`) join the pairs with fixed gaps.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.poses.pair_kernels import COST, SEEN, SUMS, WEIGHT, PyramidLevel, scale_kernel, sums_kernel
from endotsr.clips.poses.steps import moved, solved_step
from endotsr.clips.poses.views import between
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.splatting.camera import CameraPose

GAPS = (1, 4, 16)  # frames between the two of a pair
LEAST_OVERLAP, LEAST_SEEN = 0.3, 80  # fraction and number of the points of a pair that the target frame shows
FLOOR = 0.05  # least robust scale, local standard deviations
SCALES, STEPS = 2, 3  # estimates of the scales at each level, and steps tried after each
DAMPING, SOFTER, HARDER = 1e-4, 0.3, 10.0  # of the normal equations: at first, after a success, after a failure
ENOUGH = 2e-5  # rad, and fraction of the depth: after a shorter step, the scales are estimated again


class PairFit(NamedTuple):
    """How well the pairs of one level fit."""

    scale: float  # median robust standard deviation, local standard deviations of the picture
    agreeing: float  # of the points, weighted as they agree
    pairs: int
    steps: int  # accepted at this level


class Bundle(NamedTuple):
    """Refined poses, and the fit before and after, at the last level."""

    poses: list[CameraPose]
    before: PairFit
    after: PairFit


def pairs_of(count: int, gaps: tuple[int, ...] = GAPS) -> NDArray[np.intp]:
    """(P, 2) source and target: pairs with these gaps g, in both directions, from every max(1, g // 2)-th frame on."""
    found = []
    for gap in gaps:
        for i in range(0, count - gap, max(1, gap // 2)):
            found += [(i, i + gap), (i + gap, i)]
    return np.array(found, np.intp).reshape(-1, 2)


def adjusted(
    levels: list[PyramidLevel], poses: list[CameraPose], depth: float, on_step: Callable[[], object] = lambda: None,
    returns: Sequence[tuple[int, int]] = (),
) -> Bundle:  # fmt: skip
    """The poses near the given ones that minimise the residuals of all pairs, as far as the steps lead.

    levels    from coarse to fine
    poses     one per frame, near the solution
    depth     typical depth, scene units: the unit of a translation
    on_step   called after every tried step
    returns   further pairs of frames, each used in both directions

    Edges:    without a pair that overlaps, the poses are returned unchanged.
    """
    pairs = pairs_of(len(poses))
    again = np.array(returns, np.intp).reshape(-1, 2)
    pairs = np.concatenate([pairs, again, again[:, ::-1]])
    before = after = fit_of(levels[-1], pairs, poses)
    for level in levels:
        taken = 0
        for _ in range(SCALES):
            kept, scale = pair_scales(level, pairs, poses)
            if not len(kept):
                break
            poses, count = _descend(level, kept, scale, poses, depth, on_step)
            taken += count
        after = fit_of(level, pairs, poses)._replace(steps=taken)
    return Bundle(poses, before, after)


def fit_of(level: PyramidLevel, pairs: NDArray[np.intp], poses: list[CameraPose]) -> PairFit:
    """The fit of poses at a level."""
    kept, scale = pair_scales(level, pairs, poses)
    if not len(kept):
        return PairFit(float("nan"), float("nan"), 0, 0)
    sums = pair_sums(level, kept, scale, poses)
    return PairFit(float(np.median(scale)), float(sums[:, WEIGHT].sum() / sums[:, SEEN].sum()), len(kept), 0)


def _descend(
    level: PyramidLevel, pairs: NDArray[np.intp], scale: FloatArray, poses: list[CameraPose], depth: float,
    on_step: Callable[[], object],
) -> tuple[list[CameraPose], int]:  # fmt: skip
    """Levenberg-Marquardt steps with fixed scales; and the number that were accepted."""
    sums, damping, taken = pair_sums(level, pairs, scale, poses), DAMPING, 0
    for _ in range(STEPS):
        step = solved_step(sums, pairs, poses, depth, damping)
        trial = [moved(pose, part) for pose, part in zip(poses, step)]
        tried = pair_sums(level, pairs, scale, trial)
        on_step()
        if tried[:, COST].sum() < sums[:, COST].sum():
            poses, sums, damping, taken = trial, tried, damping * SOFTER, taken + 1
        else:
            damping *= HARDER
        if np.abs(step / np.array([1, 1, 1, depth, depth, depth])).max() < ENOUGH:
            break
    return poses, taken


def _relative(pairs: NDArray[np.intp], poses: list[CameraPose]) -> FloatArray:
    """(P, 3, 4): the pose of every target relative to its source."""
    found = np.empty((len(pairs), 3, 4))
    for k, (source, target) in enumerate(pairs):
        found[k, :, :3], found[k, :, 3] = between(poses, source, target)
    return found


def pair_scales(
    level: PyramidLevel, pairs: NDArray[np.intp], poses: list[CameraPose]
) -> tuple[NDArray[np.intp], FloatArray]:
    """The pairs that overlap, and their robust scales."""
    scale, seen = np.empty(len(pairs)), np.empty(len(pairs), np.intp)
    parallel_for(scale_kernel, len(pairs), level, pairs, _relative(pairs, poses), FLOOR, scale, seen)
    points = np.diff(level.first)[pairs[:, 0]]
    kept = (seen >= LEAST_SEEN) & (seen >= LEAST_OVERLAP * points)
    return pairs[kept], scale[kept]


def pair_sums(level: PyramidLevel, pairs: NDArray[np.intp], scale: FloatArray, poses: list[CameraPose]) -> FloatArray:
    out = np.empty((len(pairs), SUMS))
    parallel_for(sums_kernel, len(pairs), level, pairs, _relative(pairs, poses), scale, out)
    return out
