"""Points of the tissue, followed through a recording and across its seams (B18d).

A point X at frame g of a window moves with the Gaussians around it:

    X(g') = X + sum_j w_j (mu_j(g') - mu_j(g)) / sum_j w_j,    w_j = o_j exp(-|X - mu_j(g)|^2 / (2 r^2)),

over the 128 nearest Gaussians, with opacity o_j and their root mean square distance r. The seam of two windows is the
frame in the middle of their overlap; there a point that has arrived is matched anew, with the Gaussians of the other
window.

In: the scene of the windows, points in its world and their frame. Out: their positions at other frames.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.kernels.arrays import BoolArray, FloatArray
from endotsr.windows.scene import WindowedScene

NEAREST = 128  # Gaussians that move a point; the error of one is of the order of the motion (B18)
STEP = 16  # frames over which errors are measured
EVERY = 3  # pixels, in rows and columns, of which one is followed


class SeamErrors(NamedTuple):
    """Mean lengths over points, scene units: after 16 frames that cross a seam, and after 16 frames that cross none."""

    across: float
    across_motion: float  # true displacement: the error of points that do not move
    inside: float
    inside_motion: float
    seams: int  # that were crossed


def seam(scene: WindowedScene, k: int) -> int | None:
    """The frame at which points pass from window k to window k + 1; None if the two share no frame."""
    windows = scene.plan.windows
    if not 0 <= k < len(windows) - 1 or not scene.plan.shared(k + 1):
        return None
    return (windows[k + 1].first + windows[k].end) // 2


def followed(scene: WindowedScene, points: FloatArray, frame: int, frames: Iterable[int]) -> FloatArray:
    """Positions (F, 3, P) of points (3, P) of frame `frame` at other frames; scene units, world axes.

    Edges:  beyond a cut, or frames that are left out, a position is NaN.
    Raises: InputError for a frame that no window shows.
    """
    chosen = list(frames)
    for g in (frame, *chosen):
        scene.parts(g)
    found = np.full((len(chosen), *points.shape), np.nan)
    for step in (1, -1):
        wanted = [i for i, g in enumerate(chosen) if (g - frame) * step > 0 or (g == frame and step > 0)]
        for i, position in _walked(scene, points, frame, sorted((step * chosen[i], i) for i in wanted), step):
            found[i] = position
    return found


def _walked(
    scene: WindowedScene, points: FloatArray, frame: int, wanted: list[tuple[int, int]], step: int
) -> Iterable[tuple[int, FloatArray]]:
    """Positions in one direction of time; `wanted` holds step x frame, ascending, and the place of each frame."""
    k, at = scene.owner(frame), frame
    while wanted:
        bound = seam(scene, k if step > 0 else k - 1)
        here = [pair for pair in wanted if bound is None or pair[0] <= step * bound]
        if bound is None:
            last = scene.plan.windows[k]
            here = [pair for pair in here if last.first <= step * pair[0] < last.end]
        move = _mover(scene, k, points, at)
        yield from ((i, move(step * g)) for g, i in here)
        if bound is None:
            return
        wanted = wanted[len(here) :]
        points, at, k = move(bound), bound, k + step


def _mover(scene: WindowedScene, k: int, points: FloatArray, frame: int) -> Callable[[int], FloatArray]:
    """Frame -> positions of points of `frame`, by the Gaussians of window k."""
    from scipy.spatial import KDTree

    own = scene.window(k)
    start = own.at(scene.local_time(k, frame))
    opacity = 1.0 / (1.0 + np.exp(-start.opacity_logit.astype(np.float64)))
    number = min(NEAREST, start.position.shape[1])
    distance, near = KDTree(start.position.T).query(points.T, k=number)
    distance, near = distance.reshape(-1, number), near.reshape(-1, number)
    spread = np.maximum(np.square(distance).mean(axis=1, keepdims=True), np.finfo(np.float32).tiny)
    weight = opacity[near] * np.exp(-np.square(distance) / (2.0 * spread))
    weight /= np.maximum(weight.sum(axis=1, keepdims=True), np.finfo(np.float64).tiny)

    def moved(other: int) -> FloatArray:
        moves = own.at(scene.local_time(k, other)).position - start.position
        return points + np.einsum("cpj,pj->cp", moves[:, near], weight)

    return moved


def seam_errors(
    scene: WindowedScene, masks: Callable[[int], BoolArray], positions: Callable[[int, int], FloatArray]
) -> SeamErrors:
    """Errors of followed points against the truth, across seams and as far from them as the windows allow.

    masks      frame -> (H, W), tissue
    positions  (frame g, other g') -> (3, H, W): where the points that g shows at its pixels are at g'
    Raises:    InputError if no seam has 8 frames of its windows on either side.
    """
    across, inside = [], []
    for k in range(len(scene.plan.windows)):
        if (at := seam(scene, k)) is not None:
            across += _lengths(scene, masks, positions, at - STEP // 2)
        begin, end = seam(scene, k - 1) or scene.plan.windows[k].first, seam(scene, k) or scene.plan.windows[k].end - 1
        if end - begin >= STEP:
            inside += _lengths(scene, masks, positions, (begin + end - STEP) // 2)
    if not across or not inside:
        raise InputError(
            f"{scene.run}: no two windows share a frame, or they are too short; allowed: windows with seams"
        )
    (error, motion), (error_inside, motion_inside) = (np.mean(found, axis=0) for found in (across, inside))
    return SeamErrors(float(error), float(motion), float(error_inside), float(motion_inside), len(across))


def _lengths(
    scene: WindowedScene, masks: Callable[[int], BoolArray], positions: Callable[[int, int], FloatArray], frame: int
) -> list[tuple[float, float]]:
    """Mean error and true motion of points of a frame after 16 frames; nothing without tissue or behind the end."""
    if frame < scene.frames[0] or frame + STEP > scene.frames[-1]:
        return []
    start, truth = positions(frame, frame), positions(frame, frame + STEP)
    grid = np.zeros(start.shape[1:], bool)
    grid[::EVERY, ::EVERY] = True
    tissue = grid & masks(frame) & np.isfinite(start).all(axis=0)
    start, truth = start[:, tissue], truth[:, tissue]
    found = followed(scene, start, frame, [frame + STEP])[0]
    known = np.isfinite(found).all(axis=0)
    if not known.any():
        return []
    error, motion = (np.linalg.norm((x - truth)[:, known], axis=0).mean() for x in (found, start))
    return [(float(error), float(motion))]
