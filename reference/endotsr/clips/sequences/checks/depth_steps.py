"""Depth that has a scale of its own in each frame, as where each is normalised, or in each part of a clip.

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
# The same of one step, and times the usual change. Without the second limit, a simulated scope that comes nearer by a
# third between two pictures is named, whose flow is wrong. Two recorded clips, whole and thinned, have 0.034 at most.
JUMP, TIMES = 0.12, 3.0


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
        self.found: list[DepthStep] = []  # at most `STEPS`, evenly spaced
        self.jumps: dict[int, DepthStep] = {}  # by the later frame: every step with more than `JUMP` unexplained
        self._sampled = {i + 1 for i in even_frames(count - 1, STEPS)} if count > 1 else set()
        self._last: tuple[int, ViewFrame] | None = None

    def add(
        self, i: int, picture: NDArray[np.uint8], depth: NDArray[np.float32] | None, tissue: BoolArray | None
    ) -> None:
        """Frame i: picture (H, W, 3), depth (H, W), 0 = none, or None; tissue (H, W), or None without masks."""
        if depth is None:
            return
        frame = frame_of(picture, tissue, depth).reduced(side_of(depth.shape[1], WIDEST))
        if self._last is not None and self._last[0] == i - 1:
            self._add_step(i, self._last[1], frame)
        self._last = i, frame

    def _add_step(self, i: int, one: ViewFrame, other: ViewFrame) -> None:
        """The step to frame i, if enough pixels have depth in both; the flow only where it is needed."""
        both = one.tissue & other.tissue & (one.depth > 0) & (other.depth > 0)
        if both.sum() < PIXELS:
            return
        change = float(np.median(np.log(other.depth[both] / one.depth[both])))
        if i not in self._sampled and abs(change) <= JUMP:
            return
        flow = dense_flow(grey_of(one.image), grey_of(other.image))
        step = DepthStep(change, float(np.median(np.hypot(*flow)[both])) / both.shape[1])
        if i in self._sampled:
            self.found.append(step)
        if step.unexplained > JUMP:
            self.jumps[i] = step

    def findings(self, where: str) -> list[Finding]:
        """A warning on depth with a scale of its own in each frame, or warnings on the steps between two scales."""
        usual = float(np.median([abs(step.change) for step in self.found])) if self.found else 0.0
        jumps = {i: step for i, step in self.jumps.items() if step.unexplained > TIMES * usual}
        return scale_finding(self.found, where) or jump_findings(jumps, where)


def loaded_steps(sequence: Sequence) -> DepthSteps:
    """The steps of a sequence in memory."""
    steps = DepthSteps(sequence.count)
    for i in range(sequence.count):
        steps.add(i, sequence.picture(i), sequence.depth[i], sequence.masks[i])
    return steps


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


def jump_findings(jumps: dict[int, DepthStep], where: str) -> list[Finding]:
    """A warning for each step after which the depth has another scale; jumps: by the later frame."""
    return [
        finding(
            "depth-scale-jump",
            where,
            f"from frame {i - 1} to {i} the depth becomes {np.exp(step.change):.2f} times as large, and the picture"
            f" moves by {step.motion:.2%} of its width (limit without motion: {np.exp(JUMP):.2f} times)",
            i,
        )
        for i, step in jumps.items()
    ]
