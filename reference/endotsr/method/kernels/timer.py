"""Stage marks for a timer, with which a benchmark splits the time of an iteration.

A function with several stages has an argument `timer: Timer = NO_TIMER` and marks each stage by
`with timer.stage(name):`. Results do not depend on the timer. `endotsr.studies.bench.clock` defines the stages and
rejects unknown names.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeVar

Result = TypeVar("Result")


class Timer(Protocol):
    """Receives the beginning and the end of every stage."""

    def stage(self, name: str) -> AbstractContextManager[object]:
        """Assign the time of the block, in its thread, to the stage `name`.

        Blocks may nest and may run in several threads at once. The time of an inner block is counted only there.
        """
        ...


class _NoTimer:
    """Measures nothing; a stage costs less than 1 us."""

    def __init__(self) -> None:
        self._nothing = nullcontext()

    def stage(self, name: str) -> AbstractContextManager[object]:
        return self._nothing


NO_TIMER = _NoTimer()


def timed(timer: Timer, stage: str, call: Callable[[], Result]) -> Callable[[], Result]:
    """`call` with its time assigned to `stage`, as an argument of `parallel_calls`."""

    def counted() -> Result:
        with timer.stage(stage):
            return call()

    return counted
