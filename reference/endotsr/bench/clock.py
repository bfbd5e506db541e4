"""Which stage the time of an iteration goes to, seen from outside: no line of the training knows of it.

While a `StageClock` watches, every public function of a stage's modules is replaced, wherever the package holds a
reference to it, by one that notes when it begins and ends. A stage is a set of modules, so a function that is added
or renamed is counted without a word here. Calls may nest: a stage gets its own time, not that of what it calls.
While several threads are in stages, each stage gets an equal part of the time. What is left (the log entry,
additions between stages) is "rest". Cost: about 1 us a call, some sixty calls.
"""

import functools
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FunctionType, ModuleType
from typing import Any

REST = "rest"
SPLAT = ("projection", "binning", "blend forward", "blend reverse")
STAGES: dict[str, tuple[str, ...]] = {
    "FDM": ("equations.deformation", "fitting.deformation_step"),  # the sweep: reverse, its Adam step, next forward
    "Fourier": ("equations.fourier", "equations.appearance", "equations.motion", "equations.matern"),
    "projection": ("splatting.covariance", "splatting.projection", "splatting.harmonics"),
    "binning": ("splatting.binning", "splatting.records"),  # sort, lists, records, gather of pair gradients
    "blend forward": ("splatting.compositing", "splatting.compositing_blocks"),
    "blend reverse": ("splatting.compositing", "splatting.compositing_blocks"),
    "L1 and SSIM": ("losses.photometric", "losses.similarity"),
    "pyramid": ("equations.laplacian", "equations.pyramid"),
    "depth and smoothness": ("losses.depth", "losses.smoothness", "opencv"),
    "Adam": ("fitting.adam", "fitting.coefficients_step"),
    "density control": ("scene.density_control",),
}
_PACKAGE, _HERE = "endotsr", "endotsr.bench"


class StageClock:
    """Seconds by stage, a list with one entry a repeat; every stage is there, with 0 if it did not run."""

    def __init__(self) -> None:
        self.repeats: list[dict[str, float]] = []
        self._stacks: dict[int, list[str]] = {}  # of each thread: the stages that it is in
        self._since = 0.0
        self._lock = threading.Lock()

    @contextmanager
    def iteration(self) -> Iterator[None]:
        """One repeat: what runs inside is divided among the stages and "rest"."""
        self.repeats.append(dict.fromkeys((*STAGES, REST), 0.0))
        self._since = time.perf_counter()
        self._stacks = {}
        yield
        with self._lock:
            self._charge()

    def _charge(self) -> None:
        """The time since the last event to the innermost stage of every thread, in equal parts."""
        now = time.perf_counter()
        active = [stack[-1] for stack in self._stacks.values() if stack] or [REST]
        for stage in active:
            self.repeats[-1][stage] += (now - self._since) / len(active)
        self._since = now

    def counted(self, function: Callable, stage: str) -> Callable:
        """The same function, whose time goes to `stage`."""

        @functools.wraps(function)
        def timed(*arguments: Any, **options: Any) -> Any:
            thread = threading.get_ident()
            with self._lock:
                self._charge()
                self._stacks.setdefault(thread, []).append(stage)
            try:
                return function(*arguments, **options)
            finally:
                with self._lock:
                    self._charge()
                    self._stacks[thread].pop()

        return timed

    @contextmanager
    def watching(self) -> Iterator["StageClock"]:
        """Count while the block lasts; afterwards every name is what it was."""
        replaced = []
        for module, name, function, stage in references():
            replaced.append((module, name, function))
            setattr(module, name, self.counted(function, stage))
        try:
            yield self
        finally:
            for module, name, function in replaced:
                setattr(module, name, function)


def references() -> list[tuple[ModuleType, str, FunctionType, str]]:
    """(module, name, function, stage) of every reference that the loaded package holds to a function of a stage."""
    found = []
    for path, module in list(sys.modules.items()):
        if not path.startswith(f"{_PACKAGE}.") or path.startswith(_HERE):
            continue
        for name, value in list(vars(module).items()):
            stage = stage_of(value) if isinstance(value, FunctionType) and not name.startswith("_") else None
            if stage:
                found.append((module, name, value, stage))
    return found


def stage_of(function: FunctionType) -> str | None:
    """The stage that the module of this function belongs to; forward and reverse blending share a module."""
    inside = function.__module__.removeprefix(f"{_PACKAGE}.")
    stages = [stage for stage, modules in STAGES.items() if inside in modules]
    if len(stages) > 1:
        return stages["reverse" in function.__name__]
    return stages[0] if stages else None
