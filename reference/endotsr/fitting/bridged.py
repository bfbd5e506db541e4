"""What the renders at the times between the training frames (B14) are compared with, made once and kept.

In: a sequence and a time between two of its training frames. Out: the targets of its losses and its camera. All
times of a gap are made at the first visit, because they need the same two flows. This module computes no loss.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from endotsr.config import Config
from endotsr.fitting.objective import TargetParts, Targets, target_parts, targets_of
from endotsr.fitting.sampling import BridgedTime
from endotsr.kernels.arrays import Array, BoolArray
from endotsr.kernels.memory import Kept
from endotsr.losses.masked_ssim import stored_target
from endotsr.sequences.between import flows_between, frame_between
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import Camera

STEPS = 65535  # of an image value in [0, 1]; 8-bit steps would be as large as the error of a good fit


class Stored(NamedTuple):
    """The targets of one time; the picture is in whole numbers: 14 bytes a pixel in place of 20."""

    image: Array  # (3, H, W) uint16, steps of 1 / STEPS
    mask: BoolArray  # (H, W)
    parts: TargetParts
    camera: Camera


@dataclass(eq=False)
class BridgedTargets:
    """The targets between the training frames of a sequence, by time."""

    sequence: Sequence
    config: Config
    stored: Kept[tuple[int, int], dict[BridgedTime, Stored]] = field(default_factory=Kept)  # by gap

    def observed(self, at: BridgedTime) -> tuple[Targets, Camera]:
        """The targets at a bridged time, in the precision of the training, and the camera there."""
        made = self.stored.get((at.earlier, at.later), lambda: self._made(at))[at]
        target = stored_target(made.image, STEPS, made.mask, self.config.training.precision)
        return targets_of(target, made.parts, self.config), made.camera

    def _made(self, wanted: BridgedTime) -> dict[BridgedTime, Stored]:
        """All times of the gap in which `wanted` lies."""
        earlier, later, _ = wanted
        found, precision = {}, self.config.training.precision
        flows, count = flows_between(self.sequence, earlier, later), 2 * (later - earlier)
        for place in range(1, count):
            made = frame_between(self.sequence, earlier, later, place / count, flows)
            image = np.rint(made.image * STEPS).astype(np.uint16)
            parts = target_parts(made.mask, made.depth.astype(precision), self.config)
            found[BridgedTime(earlier, later, place / count)] = Stored(image, made.mask, parts, made.camera)
        return found
