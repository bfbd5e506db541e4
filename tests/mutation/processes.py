"""Mutants in processes of their own, so that a wrong kernel that crashes or never ends affects its process only."""

import json
import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from mutation.checks import SUITES
from mutation.mutator import Mutant

LONGEST = 900.0  # s; a process that takes longer is ended
MEMORY = 6 << 30  # largest memory of a process, bytes


class Outcome(NamedTuple):
    """The result of one mutant: per suite the check that detected it, or ""."""

    killed: dict[str, str]
    change: float | None  # largest relative change of a gradient, where the differences are those of the right kernels


class Child(NamedTuple):
    """A process that examines one mutant."""

    mutant: Mutant
    pid: int
    pipe: int
    started: float


def start(mutant: Mutant, work: Callable[[], Outcome]) -> Child:
    """Do the work in a process of its own, so that no effect of the mutant outlasts it."""
    ours, theirs = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        try:
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            _limit_memory()
            os.write(theirs, json.dumps(work()).encode())
        finally:
            os._exit(0)
    os.close(theirs)
    return Child(mutant, pid, ours, time.monotonic())


def _limit_memory() -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def finished(children: list[Child], limit: float) -> list[tuple[Child, Outcome]]:
    """Those that ended, or were ended, since the last call; waits for at least a little."""
    ready = select.select([c.pipe for c in children], [], [], 1.0)[0]
    found = []
    for child in list(children):
        late = time.monotonic() - child.started > limit
        if child.pipe not in ready and not late:
            continue
        text = os.read(child.pipe, 1 << 16) if child.pipe in ready else b""
        if late:
            os.kill(child.pid, 9)
        os.waitpid(child.pid, 0)
        os.close(child.pipe)
        children.remove(child)
        # A process that ends without an answer was ended by the mutant: memory, stack, or a loop without an end.
        crashed = dict.fromkeys(SUITES, "") | {"properties": "the process ended"}
        found.append((child, Outcome(*json.loads(text)) if text else Outcome(crashed, None)))
    return found


def in_processes(queue: list[tuple[Mutant, Callable[[], Outcome]]], jobs: int) -> Iterator[tuple[Mutant, Outcome]]:
    """Work through the queue with a fixed number of processes; results come in the order in which they end."""
    children: list[Child] = []
    waiting = list(reversed(queue))
    try:
        while waiting or children:
            while waiting and len(children) < jobs:
                children.append(start(*waiting.pop()))
            for child, outcome in finished(children, LONGEST):
                yield child.mutant, outcome
    finally:  # the caller may stop early
        for child in children:
            os.kill(child.pid, 9)
            os.waitpid(child.pid, 0)
