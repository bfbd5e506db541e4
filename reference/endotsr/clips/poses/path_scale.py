"""The scale of a reconstruction, from depth at the pixels where its points are seen.

In: for each frame, the depth of the clip over the depth of the points. Out: `PathScale`. The median of a frame is its
scale. All frames of a reconstruction share one scale; if theirs differ, the depth has another scale or shape
from frame to frame, and no scale of the path is right.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.poses.structure import Structure
from endotsr.clips.poses.views import Views, known_depth
from endotsr.method.kernels.arrays import FloatArray

LEAST_POINTS = 12  # with depth, for the scale of a frame; as many as a resection needs
LEAST_FRAMES = 3
MOST_FRAMES = 90.0  # percentile of the frames that has to be near the common scale
LARGEST_SPREAD = 0.1
"""Ruling. A frame whose scale is off by this predicts a motion of 4 pixels (`movement.WANTED`) wrongly by 0.4, which is
about the slack that the check of given poses allows (`agreement.SLACK`)."""
LARGEST_INSIDE = 0.5  # ruling: beyond it, depth and points do not show one shape


class PathScale(NamedTuple):
    """One scale for all frames, and how well they agree on it."""

    factor: float  # lengths of the depth per length of the reconstruction; NaN: too few frames
    spread: float  # 90 % of the frames are within this fraction of it
    inside: float  # median over frames of the same for the points of one frame
    frames: int  # with enough points

    @property
    def told(self) -> bool:
        """Whether the frames agree, and depth and points have one shape."""
        return self.frames >= LEAST_FRAMES and self.spread <= LARGEST_SPREAD and self.inside <= LARGEST_INSIDE

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if self.frames < LEAST_FRAMES:
            return (
                f"{self.frames} frames have {LEAST_POINTS} points with depth, {LEAST_FRAMES} are needed: the scale of"
                " the path cannot be told"
            )
        base = (
            f"by the depth of {self.frames} frames, 90 % of them within {self.spread:.1%} of the common scale, and 90 %"
            f" of the points of a frame within {self.inside:.1%} of its own"
        )
        if self.told:
            return f"the path is scaled {base}"
        return (
            f"the scale of the path cannot be told {base}; the limits are {LARGEST_SPREAD:.0%}, and"
            f" {LARGEST_INSIDE:.0%} for the points"
        )


def path_scale(ratios: list[FloatArray]) -> PathScale:
    """The common scale.

    ratios  per frame, (k,) depth of the clip over depth of the points; values that are not positive and finite, and
            frames with fewer than `LEAST_POINTS` others, are left out
    """
    known = [np.log(row[np.isfinite(row) & (row > 0)]) for row in ratios]
    known = [row for row in known if len(row) >= LEAST_POINTS]
    if len(known) < LEAST_FRAMES:
        return PathScale(float("nan"), float("nan"), float("nan"), len(known))
    scales = np.array([np.median(row) for row in known])
    inside = np.median([_spread(row) for row in known])
    return PathScale(float(np.exp(np.median(scales))), _spread(scales), float(inside), len(known))


def _spread(logarithms: FloatArray) -> float:
    """The fraction within which 90 % of the values are about their median."""
    apart = np.abs(logarithms - np.median(logarithms))
    return float(np.expm1(np.percentile(apart, MOST_FRAMES, method="inverted_cdf")))


def scale_of(found: Structure, views: Views) -> PathScale:
    """The scale of a reconstruction by the depth of the views."""
    return path_scale([_ratios(found, views, k) for k in range(views.count)])


def _ratios(found: Structure, views: Views, k: int) -> FloatArray:
    depth = known_depth(views.depth[k])
    column, row = np.floor(found.pixels[k]).astype(np.intp).T
    inside = (column >= 0) & (column < depth.shape[1]) & (row >= 0) & (row < depth.shape[0])
    return depth[row[inside], column[inside]] / found.depth(k)[inside]
