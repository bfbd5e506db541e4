"""Tissue points tracked through a recording and across its seams (B18d).

A point X at frame g of a window moves with the nearest Gaussians:

    X(g') = X + sum_j w_j (mu_j(g') - mu_j(g)) / sum_j w_j,    w_j = o_j exp(-|X - mu_j(g)|^2 / (2 r^2)),

over the 128 nearest Gaussians, with opacity o_j and root mean square distance r. The seam of two windows is the middle
frame of their overlap. At a seam, the nearest Gaussians of the next window are selected anew.

In: the scene of the windows, points in world coordinates and their frame. Out: their positions at other frames.
"""

from collections.abc import Callable, Iterable

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.studies.windows.scene import WindowedScene

NEAREST = 128  # Gaussians averaged; the motion of a single one is undetermined (B18)


def seam(scene: WindowedScene, k: int) -> int | None:
    """The frame at which points pass from window k to window k + 1; None if the two share no frame."""
    windows = scene.plan.windows
    if not 0 <= k < len(windows) - 1 or not scene.plan.shared(k + 1):
        return None
    return (windows[k + 1].first + windows[k].end) // 2


def followed(scene: WindowedScene, points: FloatArray, frame: int, frames: Iterable[int]) -> FloatArray:
    """Positions (F, 3, P) at `frames` of points (3, P) given at `frame`; scene units, world axes.

    Edges:  a position is NaN beyond a cut or a gap of left-out frames.
    Raises: InputError for a frame outside every window.
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
    """Positions in one direction of time; `wanted`: pairs of step x frame, ascending, and the index of the frame."""
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
    """Function frame -> positions of the points given at `frame`, moved by the Gaussians of window k."""
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
