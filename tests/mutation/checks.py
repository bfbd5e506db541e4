"""The checks of mutants: gradient checks, golden cases and tests, each with the kernels it runs.

The suites: `gradcheck` the public checker on the registered pairs; `oracle` tests that compare with the definition,
with tests/oracle or with a library; `hard` the tests named after the catalogue of hard cases; `properties` all other
tests; `golden` the expected arrays of the folder golden/.
"""

import inspect
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import CodeType
from typing import Any, NamedTuple

import numpy as np
import pytest
from _pytest.runner import runtestprotocol

from endotsr.port.contract import all_operations
from endotsr.port.gradcheck import Pair
from endotsr.port.judge.compare import judged
from endotsr.port.judge.format import Case
from endotsr.port.judge.store import Golden
from endotsr.port.reference import reference, stored
from mutation.gradients import Recorded, live, replay

SUITES: tuple[str, ...] = ("gradcheck", "oracle", "golden", "hard", "properties")
COLLECTING = (  # options of pytest, in this process: slow tests are among the checks
    *("-q", "-s", "-n", "0", "-m", "not faults and not nightly"),
    *("-p", "no:timeout", "-p", "no:cacheprovider", "-p", "no:warnings"),
)
SLOW = 1.0  # s of processor time; a check that takes longer without the compiler is left out
WAIT = 60.0  # s of the clock beside the processor time: a check may wait for another process, or for its turn
INDEPENDENT = re.compile(r"oracle|mpmath|scipy|skimage|cv2|definition\.|by_definition|(the|its|their)_definition")
BLOCKS = 0.01  # s; a forward pass as quick as this is also differentiated block by block


class Check(NamedTuple):
    """One check. `run` returns the fault as text, "" if there is none, and may put facts into a mapping."""

    suite: str
    name: str
    run: Callable[[dict[str, Any]], str]
    seconds: float = 0.0
    kernels: frozenset[str] = frozenset()


class OutOfTime(BaseException):
    """Raised by the timer inside a check; no test catches it."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Processor time, so that other work on the machine does not matter; a check that only waits ends after WAIT."""

    def stop(*_):
        raise OutOfTime

    timers = ((signal.SIGVTALRM, signal.ITIMER_VIRTUAL, seconds), (signal.SIGALRM, signal.ITIMER_REAL, WAIT + seconds))
    before = [signal.signal(number, stop) for number, _, _ in timers]
    for _, timer, limit in timers:
        signal.setitimer(timer, limit, 5.0)  # again, in case the first is swallowed
    try:
        yield
    finally:
        for (number, timer, _), handler in zip(timers, before):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)


def run(check: Check, seconds: float, facts: dict[str, Any]) -> str:
    """The fault as text; exceptions and timeouts are faults too."""
    try:
        with limited(seconds), np.errstate(all="ignore"):
            return check.run(facts)
    except OutOfTime:
        return "out of time"
    except Exception as error:
        return type(error).__name__


def surveyed(check: Check, kernels: Mapping[CodeType, str], limit: float = SLOW) -> Check | str:
    """The check with its time and the kernels it runs, or the reason why it is left out."""
    seen: set[CodeType] = set()

    def watch(frame, event, argument):
        if event == "call":
            seen.add(frame.f_code)

    start = time.process_time()
    sys.setprofile(watch)
    try:
        wrong = run(check, limit, {})
    finally:
        sys.setprofile(None)
    if wrong:
        return wrong
    names = frozenset(kernels[code] for code in seen & kernels.keys())
    return check._replace(seconds=time.process_time() - start, kernels=names)


# ---- the checks ----


def of_pair(pair: Pair, recorded: Recorded, blocks: bool) -> list[Check]:
    """Judge the gradient against the differences of the right kernels, and differentiate again."""

    def judge(facts: dict[str, Any]) -> str:
        wrong, change = replay(pair, recorded)
        facts["change"] = max(facts.get("change", 0.0), change)
        return wrong

    def differentiate(_: dict[str, Any]) -> str:
        return live(pair, blocks=blocks)

    return [
        Check("gradcheck", f"{pair.name} reverse", judge),
        Check("gradcheck", f"{pair.name} forward", differentiate),
    ]


def forward_only(pair: Pair, recorded: Recorded) -> Check:
    """Runs what the forward pass runs; its kernels are those that need new differences."""

    def call(_: dict[str, Any]) -> str:
        pair.forward(recorded.inputs)
        return ""

    return Check("gradcheck", f"{pair.name} forward", call)


def of_case(golden: Golden, case: Case) -> list[Check]:
    """The reference against the stored answer, both paths, and in float32."""
    operation = all_operations()[case.operation]
    inputs = {name: golden.array(case, a.file) for name, a in case.inputs.items()}
    expected = {name: golden.array(case, o.file) for name, o in case.outputs.items()}

    def one(precision: str, path: str) -> Check:
        def compare(_: dict[str, Any]) -> str:
            found = reference(operation, inputs, case.settings, precision, path)
            for name, output in case.outputs.items():
                got = stored(found[name])
                verdict = judged(got, expected[name], output.compare, precision)
                if got.shape != expected[name].shape or not verdict.passed:
                    return f"{name}: {verdict.reason}"
            return ""

        return Check("golden", f"{case.name} {precision} {path}", compare)

    return [one("float64", "definition"), one("float64", "blocks"), one("float32", "definition")]


def of_item(item: pytest.Item) -> Check:
    """A test of the repository."""
    assert isinstance(item, pytest.Function)

    def call(_: dict[str, Any]) -> str:
        reports = runtestprotocol(item, log=False, nextitem=None)
        for report in reports:
            if report.failed:
                return f"failed in {report.when}"
        return "skipped" if any(r.skipped for r in reports) else ""

    return Check(suite_of(item), item.nodeid, call)


def suite_of(item: pytest.Function) -> str:
    """The suite of a test, by its name and then by its oracle."""
    if item.name.startswith("test_hard_"):
        return "hard"
    source = inspect.getsource(item.function)
    return "oracle" if INDEPENDENT.search(item.nodeid + source) else "properties"
