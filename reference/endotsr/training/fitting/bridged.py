"""Targets of the renders at times between training frames (B14), computed once and cached.

In: a sequence and a time between two of its training frames. Out: the targets of its losses and its camera. The first
visit of a gap computes the targets of all its times, which need the same two flows. This module computes no loss.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.between import flows_between, frame_between
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config
from endotsr.method.kernels.arrays import Array
from endotsr.method.kernels.memory import Kept
from endotsr.method.losses.masked_ssim import stored_target
from endotsr.method.splatting.camera import Camera
from endotsr.training.fitting.objective import Targets, optional_depth_target, targets_of
from endotsr.training.fitting.packed import (
    STEPS,
    PackedDepth,
    PackedMask,
    packed_depth,
    packed_mask,
    packed_supports,
    unpacked_depth,
    unpacked_mask,
    unpacked_supports,
)
from endotsr.training.fitting.sampling import BridgedTime


class Stored(NamedTuple):
    """The targets of one time as integers and bits, 8.5 instead of 20 bytes per pixel; disabled parts are None."""

    image: Array  # (3, H, W) uint16, steps of 1 / STEPS
    mask: PackedMask
    depth: PackedDepth | None
    supports: tuple[PackedMask, ...] | None
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
        mask, precision = unpacked_mask(made.mask), self.config.training.precision
        depth = None if made.depth is None else unpacked_depth(made.depth, precision)
        rule = self.config.loss.upsampling
        supports = None if made.supports is None else unpacked_supports(made.supports, mask, rule)
        return targets_of(stored_target(made.image, STEPS, mask, precision), depth, supports, self.config), made.camera

    def _made(self, wanted: BridgedTime) -> dict[BridgedTime, Stored]:
        """The targets of all times of the gap that contains `wanted`."""
        earlier, later, _ = wanted
        config, precision, found = self.config, self.config.training.precision, {}
        flows, count = flows_between(self.sequence, earlier, later), 2 * (later - earlier)
        for place in range(1, count):
            made = frame_between(self.sequence, earlier, later, place / count, flows)
            depth = optional_depth_target(made.depth.astype(precision), made.mask, config)
            found[BridgedTime(earlier, later, place / count)] = Stored(
                np.rint(made.image * STEPS).astype(np.uint16),
                packed_mask(made.mask),
                None if depth is None else packed_depth(depth),
                packed_supports(made.mask, config.loss.upsampling) if config.model.laplacian else None,
                made.camera,
            )
        return found
