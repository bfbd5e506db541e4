"""Frames whose prior depth reaches much farther than in the frames around them (ruling `depth outliers`).

The depth loss (B8) divides a depth by the largest one of its frame. A few wrong far depths, where stereo matching
failed, change the loss in the whole frame. The clip to percentiles leaves them where they are more than a few. In: the
far limits of the frames. Out: the frames beyond the usual limit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

AROUND = 5  # frames on either side whose limits are usual; a longer change of the scene is not an outlier
FARTHER = 1.5  # times the usual limit; the largest ratio of the other frames of two published clips is 1.1


class Outlying(NamedTuple):
    """A frame with outliers."""

    frame: int  # number in the sequence, from 0
    ratio: float  # of its far limit to the usual one
    usual: float  # usual far limit, in the unit of the depth


def outlying_frames(limits: NDArray[np.float64]) -> list[Outlying]:
    """The frames whose far limit is more than `FARTHER` times the median limit of the frames around them.

    limits   (n,) 99.8th percentile of the depth of every frame; 0 without depth, which is no limit

    Edges:   a frame is compared with up to `AROUND` frames on either side, and not with itself; with fewer than three
             such limits it is never an outlier.
    """
    found = []
    for frame in np.flatnonzero(limits > 0):
        around = np.delete(limits[max(0, frame - AROUND) : frame + AROUND + 1], min(frame, AROUND))
        around = around[around > 0]
        usual = float(np.median(around)) if around.size > 2 else np.inf
        if limits[frame] > FARTHER * usual:
            found.append(Outlying(int(frame), float(limits[frame] / usual), usual))
    return found


def remove_outliers(depth: NDArray[np.float32], found: list[Outlying]) -> str:
    """Set the depths beyond the usual limit to 0, which is no depth, in place; returns a note.

    depth    (n, H, W), in the unit of the limits
    """
    largest = 0.0
    for frame, _, usual in found:
        plane = depth[frame]
        beyond = plane > usual
        largest = max(largest, np.count_nonzero(beyond) / max(1, np.count_nonzero(plane)))
        plane[beyond] = 0.0
    most = f"at most {largest:.1%} of the depths of a frame"
    return f"depth: outliers removed in frame {said(found)}, {most} (sequence.depth_outliers)"


def said(found: list[Outlying]) -> str:
    """The frames and how much farther each reaches, such as `74 (2.3 times as far)`."""
    return ", ".join(f"{frame} ({ratio:.2g} times as far)" for frame, ratio, _ in found)
