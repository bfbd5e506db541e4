"""Frames at the moments between the training frames (B14), made once and kept in half the memory.

In: a sequence and a moment between two of its training frames. Out: the `Frame` that its render is compared with. All
moments of a gap are made at the first visit, because they need the same two flows. This module computes no loss.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from endotsr.fitting.sampling import Moment
from endotsr.kernels.arrays import Array, BoolArray
from endotsr.kernels.memory import Kept
from endotsr.sequences.between import flows_between, frame_between
from endotsr.sequences.sequence import Frame, Sequence
from endotsr.splatting.camera import Camera

STEPS = 65535  # of an image value in [0, 1]; 8-bit steps would be as large as the error of a good fit


class Stored(NamedTuple):
    """A frame in whole numbers and half precision: 11 bytes a pixel in place of 17."""

    image: Array  # (3, H, W) uint16, steps of 1 / STEPS
    mask: BoolArray  # (H, W)
    depth: Array  # (H, W) float32, scene units
    time: float
    camera: Camera


@dataclass(eq=False)
class Moments:
    """The frames between the training frames of a sequence, by moment."""

    sequence: Sequence
    stored: Kept[tuple[int, int], dict[Moment, Stored]] = field(default_factory=Kept)  # by gap

    def frame(self, moment: Moment, dtype: np.dtype | str = "float32") -> Frame:
        """The frame at a moment, with image and depth in `dtype`."""
        gap = self.stored.get((moment.earlier, moment.later), lambda: self._made(moment))
        image, mask, depth, time, camera = gap[moment]
        return Frame(np.divide(image, STEPS, dtype=dtype), mask, depth.astype(dtype), time, camera)

    def _made(self, wanted: Moment) -> dict[Moment, Stored]:
        """All moments of the gap in which `wanted` lies."""
        earlier, later, _ = wanted
        found = {}
        flows, count = flows_between(self.sequence, earlier, later), 2 * (later - earlier)
        for place in range(1, count):
            made = frame_between(self.sequence, earlier, later, place / count, flows)
            image = np.rint(made.image * STEPS).astype(np.uint16)
            moment = Moment(earlier, later, place / count)
            found[moment] = Stored(image, made.mask, made.depth, made.time, made.camera)
        return found
