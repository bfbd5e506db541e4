"""Frames in another order than that of time, as names that are sorted as text give: 1, 10, 11, 2.

In: small pictures of the frames. Out: findings. A break is a step between neighbours that is large for the clip, where
both frames have a frame elsewhere that is much nearer. At a cut to another scene neither has one. Frames without any
order are as far from their neighbours as from those two apart, while others are nearer.
"""

import numpy as np

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray, FloatArray

FEWEST, LONGEST = 12, 600  # frames of a clip that is looked at; more are left out
LARGE, NEARER = 2.0, 0.5  # a step at a break: times the median; distance of the frames elsewhere, of the step
# Breaks: at most 3 on 12 clips, also every second or third frame and parts of the pictures, and those 3 where the
# exposure jumps. Names sorted as text have 8 or more in 63 frames; two frames in each other's place have 4.
MOST = 4
# Without order: distance to the nearest frame but the neighbours, of that to the nearer neighbour (median), and the
# mean step relative to that across one frame. Ten random orders have up to 0.70 and at least 0.9; these clips have at
# least 0.84 where the second number is 0.9 or more.
ELSEWHERE, STEADY = 0.75, 0.92


def order_findings(small: list[np.ndarray], names: list[str], readable: BoolArray, where: str) -> list[Finding]:
    """A warning on frames that are in another order than that of time.

    small      pictures (h, w, 3) of the frames
    readable   frames that are neither black nor white
    """
    small = small[:LONGEST]
    if len(small) < FEWEST or not readable.all() or len({picture.shape for picture in small}) != 1:
        return []
    apart = distances(small)
    steps, across = np.diagonal(apart, 1), np.diagonal(apart, 2)
    others = apart.copy()
    for k in (-1, 0, 1):
        others[np.arange(max(0, -k), len(others) - max(0, k)), np.arange(max(0, k), len(others) + min(0, k))] = np.inf
    nearest = others.min(axis=1)
    limit = LARGE * float(np.median(steps))
    found = (steps > limit) & (np.maximum(nearest[:-1], nearest[1:]) < NEARER * steps)
    if found.sum() >= MOST:
        frames = (np.flatnonzero(found) + 1).tolist()
        what = (
            f"{len(frames)} steps between frames are more than {LARGE:g} times as large as usual, and both frames have"
            f" one elsewhere that is nearer ({MOST} or more tell another order): at"
            f" {shortened([names[i] for i in frames])}"
        )
        return [finding("frame-order", where, what, frames[0])]
    beside = np.minimum(np.append(steps, np.inf), np.insert(steps, 0, np.inf))
    elsewhere = float(np.median(nearest / np.maximum(beside, 1e-6)))
    steady = float(steps.mean() / max(across.mean(), 1e-6))
    if elsewhere > ELSEWHERE or steady < STEADY:
        return []
    what = (
        f"neighbours differ {steady:.2f} times as much as frames two apart (limit {STEADY}), and another frame is"
        f" nearer than both neighbours ({elsewhere:.2f} times as far, limit {ELSEWHERE})"
    )
    return [finding("frame-order", where, what)]


def distances(small: list[np.ndarray]) -> FloatArray:
    """(n, n) mean differences of the pictures at equal brightness, grey levels, at every second of their pixels."""
    pixels = np.stack([picture[::2, ::2].astype(np.float32).ravel() for picture in small])
    means = pixels.mean(axis=1, keepdims=True)
    pixels *= means.mean() / np.maximum(means, 1.0)
    return np.stack([np.abs(pixels - one).mean(axis=1) for one in pixels]).astype(np.float64)
