"""Density control, equation (B11): add Gaussians where the screen gradient is large, remove those that are faint.

In: Gaussians and accumulated screen gradients. Out: new Gaussians, all arrays gathered by one index, and the gather
plan, with which the caller gathers its own arrays with one column per Gaussian. This module is independent of
optimiser, renderer and iteration number.

Rules. A Gaussian is pruned if its opacity is below `prune_opacity`. A survivor whose mean screen gradient (NDC units)
reaches `gradient_threshold` is cloned if its largest semi-axis is at most `dense_fraction` x extent. Otherwise it is
split: two children, sampled from the parent and smaller by `SHRINK`, replace it. `growth = "budget"` selects the
Gaussians with the largest gradients instead; their number is the room below `maximum` after pruning, divided by the
remaining densifications and rounded up. Scales are canonical, not deformed. Children inherit every other array.
Optimiser moments start at zero for clones and children (`GatherPlan`). Clones are not split in the same call.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.config import DensityConfig
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray, IndexArray
from endotsr.method.kernels.gather import gather_columns
from endotsr.method.splatting.camera import Camera, camera_centre
from endotsr.training.scene.gaussians import Gaussians, arrays

CHILDREN = 2  # of a split Gaussian
SHRINK = 0.8 * CHILDREN  # the children's semi-axes are 1/1.6 of the parent's
CAMERA_MARGIN = 1.1  # of the extent measured from cameras
LARGEST_LOG_SCALE = 40.0  # log-scales are clipped to it before exponentiation


class DensityStatistics(NamedTuple):
    """Screen gradients accumulated since the last densification; updated in place."""

    gradient_sum: NDArray[np.float64]  # (N,) sum of gradient norms, loss per NDC unit
    visits: NDArray[np.int64]  # (N,) number of views in which the Gaussian was visible


class GatherPlan(NamedTuple):
    """Origin of the M new Gaussians: survivors first, then the fresh ones (clones and children)."""

    source: IndexArray  # (M,) index among the old Gaussians: itself, or the parent
    survivors: int  # first fresh column; all later columns are fresh


class Densified(NamedTuple):
    """Result of `densify`; counts refer to the Gaussians before it."""

    gaussians: Gaussians
    plan: GatherPlan  # for moments and all other arrays with one column per Gaussian
    statistics: DensityStatistics  # all zero
    cloned: int
    split: int
    pruned: int


def empty_statistics(count: int) -> DensityStatistics:
    """Zeros for N Gaussians."""
    return DensityStatistics(np.zeros(count, np.float64), np.zeros(count, np.int64))


def gather_statistics(
    statistics: DensityStatistics, d_mean: FloatArray, visible: NDArray[np.bool_], width: int, height: int
) -> None:
    """Add one view: norm of (g_u W/2, g_v H/2) for every visible Gaussian, in place.

    d_mean   (2, N) gradient with respect to the projected centre, loss per pixel
    visible  (N,) bool; the entries of the others are unchanged
    """
    if d_mean.shape != (2, visible.size) or visible.shape != statistics.visits.shape:
        raise ValueError(f"statistics of {statistics.visits.size}, got {d_mean.shape} gradients, {visible.shape} flags")
    g_x, g_y = d_mean[0] * np.float64(0.5 * width), d_mean[1] * np.float64(0.5 * height)
    statistics.gradient_sum[:] += np.where(visible, np.sqrt(g_x * g_x + g_y * g_y), 0.0)
    statistics.visits[:] += visible


def scene_extent(config: DensityConfig, cameras: Sequence[Camera]) -> float:
    """The extent that separates clones from splits, scene units.

    A number is used unchanged. `cameras`: 1.1 x the largest distance of a camera from the mean of all cameras.
    Raises: InputError for `cameras` if all cameras coincide: extent 0 would split everything and clone nothing.
    """
    if config.extent != "cameras":
        return float(config.extent)
    centres = np.stack([camera_centre(c) for c in cameras]).astype(np.float64)
    radius = float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
    if not radius > 1e-9 * max(1.0, float(np.abs(centres).max())):
        raise InputError('density.extent: "cameras" needs a moving camera, all positions coincide; give a number > 0')
    return CAMERA_MARGIN * radius


def densify(
    gaussians: Gaussians,
    statistics: DensityStatistics,
    config: DensityConfig,
    rng: np.random.Generator,
    extent: float,
    remaining: int = 1,
) -> Densified:
    """Clone, split and prune in one gather; the inputs are not changed.

    extent   scene units, see `scene_extent`
    remaining  number of densifications from this one to the last; divides a budget
    returns  survivors in their old order, then clones, first children and second children, each in the order of
             their parents; the plan of this order; statistics of zeros

    Edges: an unvisited Gaussian has gradient 0 and is never selected by a budget. N = 0 and pruning down to 0 are
           allowed. If `maximum` leaves too little room, the candidates with the largest gradients are selected (ties
           by index).
    Draws: one `rng.standard_normal((2, 3, S))` for S split parents, none if S = 0.
    """
    alive, clone, split = _choose(gaussians, statistics, config, extent, remaining)
    keep = alive.copy()
    keep[split] = False
    survivors = np.flatnonzero(keep)
    source = np.concatenate([survivors, clone, *[split] * CHILDREN])
    gathered = {name: gather_columns(a, source, source.size) for name, a in arrays(gaussians).items()}
    result = gaussians._replace(**gathered)
    if split.size:
        _place_children(result, gaussians, split, rng)
    pruned = gaussians.count - int(alive.sum())
    plan, fresh = GatherPlan(source, survivors.size), empty_statistics(source.size)
    return Densified(result, plan, fresh, clone.size, split.size, pruned)


def _choose(
    gaussians: Gaussians, statistics: DensityStatistics, config: DensityConfig, extent: float, remaining: int
) -> tuple[NDArray[np.bool_], IndexArray, IndexArray]:
    """Which Gaussians stay (N,) bool, and the indices of those to clone and to split, ascending."""
    if statistics.visits.size != gaussians.count:
        raise ValueError(f"statistics of {statistics.visits.size} for {gaussians.count} Gaussians")
    alive = ~_fainter_than(gaussians.opacity_logit, config.prune_opacity)
    steepness = statistics.gradient_sum / np.maximum(statistics.visits, 1)
    room = max(0, config.maximum - int(alive.sum()))  # a clone and a split both add one
    if config.growth == "budget":
        candidates, room = np.flatnonzero(alive & (steepness > 0)), -(-room // remaining)
    else:
        candidates = np.flatnonzero(alive & (steepness >= config.gradient_threshold))
    if candidates.size > room:
        steepest = np.argsort(-steepness[candidates], kind="stable")[:room]
        candidates = np.sort(candidates[steepest])
    largest = np.exp(np.minimum(gaussians.log_scale.max(axis=0), LARGEST_LOG_SCALE).astype(np.float64))
    small = largest[candidates] <= config.dense_fraction * extent
    return alive, candidates[small], candidates[~small]


def _fainter_than(logit: FloatArray, opacity: float) -> NDArray[np.bool_]:
    """Whether sigmoid(logit) < opacity; comparing logits avoids overflow."""
    if opacity <= 0.0:
        return np.zeros(logit.shape, bool)
    bound = np.log(opacity) - np.log1p(-opacity) if opacity < 1.0 else np.inf
    return logit.astype(np.float64) < bound


def _place_children(result: Gaussians, parents: Gaussians, split: IndexArray, rng: np.random.Generator) -> None:
    """Write position and scale of the children, the last 2 S columns: mu + R(q) (exp(s) n), s - ln 1.6."""
    noise = rng.standard_normal((CHILDREN, 3, split.size))
    log_scale = parents.log_scale[:, split].astype(np.float64)
    rotation = _rotations(parents.quaternion[:, split].astype(np.float64))
    axes = np.exp(np.clip(log_scale, -LARGEST_LOG_SCALE, LARGEST_LOG_SCALE))
    first = result.count - CHILDREN * split.size
    for child in range(CHILDREN):
        columns = slice(first + child * split.size, first + (child + 1) * split.size)
        local = axes * noise[child]
        offset = np.stack([(rotation[row] * local).sum(axis=0) for row in range(3)])
        result.position[:, columns] = parents.position[:, split] + offset
        result.log_scale[:, columns] = log_scale - np.log(SHRINK)


def _rotations(quaternion: FloatArray) -> FloatArray:
    """Rotation matrices (3, 3, S) of raw quaternions (4, S); a zero quaternion is the identity."""
    largest = np.abs(quaternion).max(axis=0)
    q = np.where(largest > 0.0, quaternion / np.where(largest > 0.0, largest, 1.0), [[1.0], [0.0], [0.0], [0.0]])
    w, x, y, z = q / np.sqrt((q * q).sum(axis=0))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
