"""Which wrong versions of a port the golden cases refuse, and which of the others compute something else at all.

    python tests/port/mutants/survey.py definition|by_hand [--only MODULE] [--golden DIR] [--apart] [--out FILE.json]

Each function of a port is changed in one place at a time (`kinds.py`) and answers the cases that run it, in float64.
A version that ends with an error in every case is not counted. `--apart` asks the survivors other requests (`fuzz.py`):
a version that none tells from the right port is taken for equivalent.
"""

import argparse
import contextlib
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]
from mutants import fuzz, ports  # noqa: E402
from mutants.kinds import wrong_versions  # noqa: E402

from endotsr.port.judge.compare import judged  # noqa: E402
from endotsr.port.judge.format import Case  # noqa: E402
from endotsr.port.judge.store import Golden, golden_folder, read_golden  # noqa: E402
from mutation.mutator import in_place  # noqa: E402

LIMIT = 10.0  # s of one answer
ERRORS = 3  # cases that end with an error, after which a version is not counted
SLOW = 0.02  # s of a case, of which fewer other requests are made
Outcomes = dict[str, list[str]]  # by version: kind, outcome, case or operation


class Asked(NamedTuple):
    """A case with its inputs, the outputs that the right port passes, its functions, and the seconds of the port."""

    case: Case
    inputs: dict[str, Any]
    passed: tuple[str, ...]
    functions: frozenset[str]
    seconds: float


class TooLong(Exception):
    """A wrong version does not end."""


def _stop(*_: Any) -> None:
    raise TooLong


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """At most LIMIT seconds inside, without warnings."""
    signal.signal(signal.SIGALRM, _stop)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def passes(golden: Golden, case: Case, names: tuple[str, ...], found: dict[str, Any]) -> bool:
    """Whether one legal answer of the case fits all of these outputs."""
    return any(all(_fits(golden, case, n, found.get(n), k) for n in names) for k in range(case.answers))


def _fits(golden: Golden, case: Case, name: str, got: Any, answer: int) -> bool:
    output, got = case.outputs[name], np.asarray(np.nan if got is None else got)
    right = golden.array(case, output.answer(answer))
    if got.shape != right.shape or got.dtype.kind == "c":
        return False
    return judged(got, right, output.compare, "float64", output.order).passed


def watched(port: ports.Port, operation: str, inputs: dict[str, Any], settings: Any) -> tuple[dict, frozenset[str]]:
    """An answer, and the functions that it runs."""
    names, ran = port.names, set()

    def watch(frame: Any, event: str, _: Any) -> None:
        if event == "call" and frame.f_code in names:
            ran.add(names[frame.f_code])

    sys.setprofile(watch)
    try:
        return port.answer(operation, inputs, settings), frozenset(ran)
    finally:
        sys.setprofile(None)


def prepared(port: ports.Port, golden: Golden) -> list[Asked]:
    """Every case of the port, the quickest first."""
    found = []
    for case in (case for case in golden.cases if case.operation in port.operations):
        inputs = golden.inputs(case)
        with limited():
            _, ran = watched(port, case.operation, inputs, case.settings)
            began = time.perf_counter()
            out = port.answer(case.operation, inputs, case.settings)
        seconds = time.perf_counter() - began
        good = tuple(n for n in case.outputs if n in out and passes(golden, case, (n,), out))
        found.append(Asked(case, inputs, good, ran, seconds))
    return sorted(found, key=lambda one: one.seconds)


def outcome(port: ports.Port, golden: Golden, asked: list[Asked]) -> tuple[str, str]:
    """("refused", case), ("passed", ""), or ("error", case) for a version that computes nothing."""
    errors = 0
    for one in asked:
        try:
            with limited():
                found = port.answer(one.case.operation, one.inputs, one.case.settings)
                good = passes(golden, one.case, one.passed, found)
        except TooLong:
            return "refused", one.case.name
        except Exception:
            errors += 1
            if errors >= min(len(asked), ERRORS):
                return "error", one.case.name
            continue
        if not good:
            return "refused", one.case.name
    return ("error", asked[0].case.name) if errors else ("passed", "")


def surveyed(port: ports.Port, golden: Golden, only: str = "", names: set[str] | None = None) -> Outcomes:
    """Every wrong version, those of a module, or the named ones."""
    asked, found, kills = prepared(port, golden), {}, Counter()
    for source in (source for source in port.sources if only in ("", source.name)):
        for function, mutant in wrong_versions(source):
            if names is not None and mutant.name not in names:
                continue
            cases = [one for one in asked if mutant.kernel in one.functions]
            cases.sort(key=lambda one: (one.seconds + 1e-4) / (1 + kills[mutant.kernel, one.case.name]))
            with in_place(function, mutant.code):
                result, case = outcome(port, golden, cases) if cases else ("not asked", "")
            kills[mutant.kernel, case] += result == "refused"
            found[mutant.name] = [mutant.kind, result, case]
    return found


def other_requests(port: ports.Port, golden: Golden) -> list[fuzz.Request]:
    """Requests of every operation whose right answer is finite and does not change with the last bit of an input."""
    asked, found = prepared(port, golden), []
    for one in asked:
        cases = [other.case for other in asked if other.case.operation == one.case.operation]
        for number in range(2 if one.seconds > SLOW else fuzz.PER_CASE):
            inputs, settings = fuzz.drawn(one.case, one.inputs, cases, number)
            shaken = {k: v * (1 + 1e-15) if v.dtype.kind == "f" else v for k, v in inputs.items()}
            try:
                with limited():
                    right, ran = watched(port, one.case.operation, inputs, settings)
                    other = port.answer(one.case.operation, shaken, settings)
            except Exception:
                continue  # refused by the right port
            right = {n: np.asarray(v) for n, v in right.items() if n in one.case.outputs}
            good = {n: v for n, v in right.items() if v.dtype.kind != "f" or np.isfinite(v).all()}
            good = {n: v for n, v in good.items() if not fuzz.apart({n: other[n]}, {n: v})}
            found += [fuzz.Request(one.case.operation, inputs, settings, good, ran)] if good else []
    return found


def apart(port: ports.Port, requests: list[fuzz.Request], survivors: set[str]) -> Outcomes:
    """The survivors that a request tells from the right port, with its operation."""
    found, kills = {}, Counter()
    for source in port.sources:
        for function, mutant in wrong_versions(source):
            if mutant.name not in survivors:
                continue
            some = [k for k, one in enumerate(requests) if mutant.kernel in one.functions]
            some.sort(key=lambda k: -kills[mutant.kernel, k])
            with in_place(function, mutant.code):
                told = next((k for k in some if _differs(port, requests[k])), None)
            if told is not None:
                kills[mutant.kernel, told] += 1
                found[mutant.name] = [mutant.kind, "apart", requests[told].operation]
    return found


def _differs(port: ports.Port, request: fuzz.Request) -> bool:
    try:
        with limited():
            got = port.answer(request.operation, request.inputs, request.settings)
            return fuzz.apart(got, request.right)
    except Exception:
        return True


def main(words: list[str]) -> int:
    """Survey a port; print the survivors, or those that compute something else, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("port", choices=("definition", "by_hand"))
    parser.add_argument("--only", default="", metavar="MODULE")
    parser.add_argument("--golden", type=Path, default=golden_folder())
    parser.add_argument("--apart", action="store_true", help="ask the survivors other requests")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args(words)
    port, golden = getattr(ports, options.port)(), read_golden(options.golden, verify=False)
    found = surveyed(port, golden, options.only)
    survivors = {name for name, (_, result, _) in found.items() if result == "passed"}
    if options.apart:
        found |= apart(port, other_requests(port, golden), survivors)
    shown = "apart" if options.apart else "passed"
    print(*(f"[{kind}] {name}" for name, (kind, result, _) in found.items() if result == shown), sep="\n")
    print(dict(Counter(result for _, result, _ in found.values())))
    if options.out:
        options.out.write_text(json.dumps(found, indent=0))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
