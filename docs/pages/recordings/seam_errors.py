"""Errors of points followed across the seams of windows, against a known truth.

In: the scene of the windows, masks and true positions. Out: mean lengths across seams, and inside of windows.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.studies.windows.follow import followed, seam
from endotsr.studies.windows.scene import WindowedScene

STEP = 16  # frames over which errors are measured
EVERY = 3  # pixels between followed points, in rows and columns


class SeamErrors(NamedTuple):
    """Mean lengths over points, scene units: after 16 frames across a seam, and after 16 frames inside a window."""

    across: float
    across_motion: float  # true displacement: the error of points that do not move
    inside: float
    inside_motion: float
    seams: int  # that were crossed


def seam_errors(
    scene: WindowedScene, masks: Callable[[int], BoolArray], positions: Callable[[int, int], FloatArray]
) -> SeamErrors:
    """Errors of followed points against the truth, across seams and as far from seams as the windows allow.

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
        raise InputError(f"{scene.run}: no two windows share a frame, or they are too short; use windows with seams")
    (error, motion), (error_inside, motion_inside) = (np.mean(found, axis=0) for found in (across, inside))
    return SeamErrors(float(error), float(motion), float(error_inside), float(motion_inside), len(across))


def _lengths(
    scene: WindowedScene, masks: Callable[[int], BoolArray], positions: Callable[[int, int], FloatArray], frame: int
) -> list[tuple[float, float]]:
    """Mean error and true motion of points of a frame after 16 frames; nothing without tissue or beyond the end."""
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
