"""Announcing stages to a timer, so that a benchmark can tell where the time of an iteration goes.

A function that does the work of several stages takes `timer: Timer = NO_TIMER` and marks each of them with
`with timer.stage(name):`. Comes in: nothing but the name. Goes out: nothing; results do not depend on the timer.
The stages and their meaning belong to `endotsr.bench.clock`, which refuses a name that it does not know.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeVar

Result = TypeVar("Result")


class Timer(Protocol):
    """Receives the beginning and the end of every stage."""

    def stage(self, name: str) -> AbstractContextManager[object]:
        """The time of the block, in the thread that runs it, belongs to the stage `name`.

        Blocks may nest (the inner stage then has its time to itself) and run in several threads at once.
        """
        ...


class _NoTimer:
    """Measures nothing; a stage costs some tenth of a microsecond."""

    def __init__(self) -> None:
        self._nothing = nullcontext()

    def stage(self, name: str) -> AbstractContextManager[object]:
        return self._nothing


NO_TIMER = _NoTimer()


def timed(timer: Timer, stage: str, call: Callable[[], Result]) -> Callable[[], Result]:
    """`call` with its time counted for `stage`: an argument of `parallel_calls`."""

    def counted() -> Result:
        with timer.stage(stage):
            return call()

    return counted
