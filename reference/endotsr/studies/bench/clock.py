"""Time of an iteration by stage, measured by a timer passed to the training step; median and quartiles of repeats.

In: the stages reported by the training (`endotsr.method.kernels.timer`). Out: seconds by stage, one entry per repeat.
Stages may nest; the time of an inner stage is not part of the outer one. Concurrent stages split the elapsed time
equally. The remainder (log entry, additions between stages) is "rest". An iteration has about twenty stages, and the
timer costs each of them a few calls of the clock. Results are medians and quartiles, because the largest disturbance
dominates a mean on a shared machine.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from endotsr.studies.bench.records import Spread
from endotsr.untrusted.names import choice

REST = "rest"
SPLAT = ("projection", "binning", "blend forward", "blend reverse")
STAGES: dict[str, str] = {
    "FDM": "offsets of the time bases; reverse in one sweep: gradient, Adam step, offsets of the next iteration",
    "Fourier": "atoms, colour residual, spectral motion, Matern penalty",
    "projection": "covariance, projection and harmonics, forward and reverse",
    "binning": "boxes, depth order, tile lists, records, gather of the pairs' gradients",
    "blend forward": "compositing",
    "blend reverse": "its reverse pass",
    "L1 and SSIM": "forward and reverse",
    "pyramid": "Laplacian loss, forward and reverse",
    "depth and smoothness": "forward and reverse, edge detection included",
    "Adam": "all other arrays; Fourier coefficients in one sweep with their reverse pass",
    "density control": "statistics; the densification in an iteration that densifies",
}


class StageClock:
    """A timer: seconds by stage, one entry per repeat; 0 for a stage that did not run."""

    def __init__(self) -> None:
        self.repeats: list[dict[str, float]] = []
        self._stacks: dict[int, list[str]] = {}  # thread -> its open stages
        self._since = 0.0
        self._lock = threading.Lock()

    @contextmanager
    def iteration(self) -> Iterator[None]:
        """Time one repeat: split the time of the block among the stages and "rest"."""
        self.repeats.append(dict.fromkeys((*STAGES, REST), 0.0))
        self._since = time.perf_counter()
        self._stacks = {}
        yield
        with self._lock:
            self._charge()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Assign the time of the block to the stage `name`. Raises: KeyError for an unknown stage."""
        if name not in STAGES:
            raise KeyError(f"unknown stage {name!r}; use {choice(STAGES)}")
        thread = threading.get_ident()
        with self._lock:
            self._charge()
            self._stacks.setdefault(thread, []).append(name)
        try:
            yield
        finally:
            with self._lock:
                self._charge()
                self._stacks[thread].pop()

    def _charge(self) -> None:
        """Split the time since the last event equally among the innermost stages of all threads."""
        now = time.perf_counter()
        active = [stack[-1] for stack in self._stacks.values() if stack] or [REST]
        for stage in active:
            self.repeats[-1][stage] += (now - self._since) / len(active)
        self._since = now


def spread(seconds: Sequence[float]) -> Spread:
    """Median and quartiles of times in seconds."""
    low, median, high = np.percentile(np.array(seconds) * 1e3, [25, 50, 75])
    return {"median_ms": float(median), "quartiles_ms": [float(low), float(high)]}


def repeated(work: Callable[[], object], repeats: int, warm_up: int = 1) -> list[float]:
    """Seconds of each of `repeats` calls, after `warm_up` calls for compilation and first memory access."""
    seconds = []
    for repeat in range(-warm_up, repeats):
        began = time.perf_counter()
        work()
        if repeat >= 0:
            seconds.append(time.perf_counter() - began)
    return seconds
