"""Depth that has a scale of its own in each frame, such as depth that is normalised frame by frame.

In: picture, depth and tissue of neighbouring frames. Out: findings. Tissue that comes nearer by a fraction grows in the
picture by that fraction, and its points move. Depth that changes more than the motion of the picture allows has changed
its scale.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.flow import dense_flow
from endotsr.clips.opencv.geometry import grey_of
from endotsr.clips.poses.views import ViewFrame, side_of
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.view_frames import frame_of
from endotsr.method.kernels.arrays import BoolArray

WIDEST = 160  # columns of the pictures whose flow is computed
STEPS, FEWEST = 48, 6  # steps of a clip that are looked at, and steps that a finding needs
PIXELS = 100  # with depth in both frames
GROWTH = 4.0  # change of the depth per motion of the picture in widths; a zoom about the centre has 3
LEAST = 0.02  # of the depth, beyond the motion; 0.000 at most on three recorded and eight simulated clips


class DepthStep(NamedTuple):
    """From one frame to the next, medians over the tissue with depth in both."""

    change: float  # logarithm of the ratio of the depths of a pixel
    motion: float  # length of the flow, widths of the picture

    @property
    def unexplained(self) -> float:
        """The part of the change that no motion of the picture allows."""
        return max(0.0, abs(self.change) - GROWTH * self.motion)


class DepthSteps:
    """The steps of a clip of `count` frames, from one pass over them in time order."""

    def __init__(self, count: int) -> None:
        self.found: list[DepthStep] = []
        self._sampled = {i + 1 for i in even_frames(count - 1, STEPS)} if count > 1 else set()
        self._last: tuple[int, ViewFrame] | None = None

    def add(
        self, i: int, picture: NDArray[np.uint8], depth: NDArray[np.float32] | None, tissue: BoolArray | None
    ) -> None:
        """Frame i: picture (H, W, 3), depth (H, W), 0 = none, or None; tissue (H, W), or None without masks."""
        if depth is None or not {i, i + 1} & self._sampled:
            return
        frame = frame_of(picture, tissue, depth).reduced(side_of(depth.shape[1], WIDEST))
        if i in self._sampled and self._last is not None and self._last[0] == i - 1:
            self.found += _steps(self._last[1], frame)
        self._last = i, frame


def loaded_steps(sequence: Sequence) -> list[DepthStep]:
    """The steps of a sequence in memory."""
    steps = DepthSteps(sequence.count)
    for i in range(sequence.count):
        steps.add(i, sequence.picture(i), sequence.depth[i], sequence.masks[i])
    return steps.found


def _steps(one: ViewFrame, other: ViewFrame) -> list[DepthStep]:
    """The step between two frames, if enough pixels have depth in both."""
    both = one.tissue & other.tissue & (one.depth > 0) & (other.depth > 0)
    if both.sum() < PIXELS:
        return []
    flow = dense_flow(grey_of(one.image), grey_of(other.image))
    change = np.median(np.log(other.depth[both] / one.depth[both]))
    return [DepthStep(float(change), float(np.median(np.hypot(*flow)[both])) / both.shape[1])]


def scale_finding(steps: list[DepthStep], where: str) -> list[Finding]:
    """A warning if the depth of most steps changes more than the motion of the picture allows."""
    if len(steps) < FEWEST or np.median([step.unexplained for step in steps]) < LEAST:
        return []
    change, motion = (float(np.median(np.abs(values))) for values in zip(*steps))
    what = (
        f"from frame to frame the depth changes by {change:.1%}, and the picture moves by {motion:.2%} of its width"
        f" (medians over {len(steps)} steps); motion that brings tissue nearer by {change:.1%} moves it by"
        f" {change / GROWTH:.1%} or more"
    )
    return [finding("depth-own-scale", where, what)]
