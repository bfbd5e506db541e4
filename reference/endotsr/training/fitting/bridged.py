"""Targets of the renders at times between training frames (B14), computed once and cached.

In: a sequence and a time between two of its training frames. Out: the targets of its losses and its camera. The first
visit of a gap computes the targets of all its times, which share its flows and pictures. `TargetsAhead` computes them
in a second thread before they are needed. This module computes no loss.
"""

import itertools
import threading
import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numba
import numpy as np

from endotsr.clips.flow.between import flows_between, frame_between, gap_between
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config
from endotsr.method.kernels.arrays import Array
from endotsr.method.kernels.memory import Kept
from endotsr.method.losses.masked_ssim import stored_target
from endotsr.method.splatting.camera import Camera
from endotsr.training.fitting.objective import Targets, joined_targets, optional_depth_target
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
from endotsr.training.fitting.records import NOTHING_MADE, Making
from endotsr.training.fitting.sampling import BridgedTime


class Stored(NamedTuple):
    """The targets of one time as integers and bits; disabled parts are None.

    With all parts, a pixel takes 8.4 bytes; the same in float32 and boolean arrays takes 19.3.
    """

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
    lock: threading.Lock = field(default_factory=threading.Lock)  # of `making`
    making: Making = NOTHING_MADE

    def observed(self, at: BridgedTime) -> tuple[Targets, Camera]:
        """The targets at a bridged time, in the precision of the training, and the camera there."""
        made = self.of_gap(at.earlier, at.later, waiting=True)[at]
        mask, precision = unpacked_mask(made.mask), self.config.training.precision
        depth = None if made.depth is None else unpacked_depth(made.depth, precision)
        rule = self.config.loss.upsampling
        supports = None if made.supports is None else unpacked_supports(made.supports, mask, rule)
        return joined_targets(
            stored_target(made.image, STEPS, mask, precision), depth, supports, self.config
        ), made.camera

    def of_gap(self, earlier: int, later: int, waiting: bool = False) -> dict[BridgedTime, Stored]:
        """The targets of all times of a gap, from any thread. Two threads may compute the same gap, with equal bits.

        waiting   whether the training waits for them
        """
        clock = time.perf_counter if waiting else time.thread_time

        def make() -> dict[BridgedTime, Stored]:
            began = clock()
            made = self._made(earlier, later)
            with self.lock:
                self._count(clock() - began, waiting)
            return made

        return self.stored.get((earlier, later), make)

    def _count(self, seconds: float, waiting: bool) -> None:
        """Add one gap to `making`."""
        gaps, waited, beside = self.making
        self.making = Making(gaps + 1, waited + seconds * waiting, beside + seconds * (not waiting))

    def _made(self, earlier: int, later: int) -> dict[BridgedTime, Stored]:
        """The targets of all times of a gap."""
        config, precision, found = self.config, self.config.training.precision, {}
        gap = gap_between(self.sequence, earlier, later, flows_between(self.sequence, earlier, later))
        count = 2 * (later - earlier)
        for place in range(1, count):
            made = frame_between(self.sequence, gap, place / count)
            depth = optional_depth_target(made.depth.astype(precision), made.mask, config)
            found[BridgedTime(earlier, later, place / count)] = Stored(
                np.rint(made.image * STEPS).astype(np.uint16),
                packed_mask(made.mask),
                None if depth is None else packed_depth(depth),
                packed_supports(made.mask, config.loss.upsampling) if config.model.laplacian else None,
                made.camera,
            )
        return found


class TargetsAhead:
    """A second thread that computes the targets of every gap, in order of time, while the training runs.

    It ends when every gap is stored, before the limit of `BridgedTargets.stored` would drop one, or on an exception,
    which the training then raises itself at that gap. With one thread, or with the JIT off, nothing is computed ahead.
    No result depends on it.
    """

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "TargetsAhead":
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def follow(self, bridged: BridgedTargets) -> None:
        """Compute these targets from now on, instead of earlier ones."""
        self._end()
        alone = numba.config.DISABLE_JIT or numba.get_num_threads() < 2  # type: ignore[attr-defined]
        if bridged.config.training.bridge_fraction > 0 and not alone:
            self._stop = threading.Event()
            self._thread = threading.Thread(target=_compute, args=(bridged, self._stop), daemon=True)
            self._thread.start()

    def _end(self) -> None:
        """Wait for the gap in progress."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self._thread = None


def _compute(bridged: BridgedTargets, stop: threading.Event) -> None:
    """The targets of every gap for which there is room."""
    numba.set_num_threads(1)  # of this thread
    largest = 0
    for earlier, later in itertools.pairwise(map(int, bridged.sequence.train_index)):
        before = bridged.stored.bytes
        if stop.is_set() or before + 2 * largest > bridged.stored.limit:
            return
        try:
            bridged.of_gap(earlier, later)
        except Exception:
            return  # the training meets the same exception
        largest = max(largest, bridged.stored.bytes - before)
