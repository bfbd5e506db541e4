"""Which wrong versions of a port the golden cases refuse.

    python tests/port/mutants/survey.py definition|by_hand [--only MODULE] [--out FILE.json]
"""

import argparse
import json
import resource
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]
from mutants import ports
from mutants.kinds import wrong_versions

from endotsr.port.judge.compare import judged
from endotsr.port.judge.format import Case
from endotsr.port.judge.store import Golden, golden_folder, read_golden
from mutation.mutator import in_place

LIMIT = 10  # s of one case


class Asked(NamedTuple):
    """A case with its inputs, the outputs that the right port passes, its functions, and the seconds of the port."""

    case: Case
    inputs: dict[str, Any]
    passed: tuple[str, ...]
    functions: frozenset[str]
    seconds: float


def passes(golden: Golden, case: Case, names, found) -> bool:
    """Whether one legal answer of the case fits all outputs."""
    for k in range(case.answers):
        for name in names:
            right, output = golden.array(case, case.outputs[name].answer(k)), case.outputs[name]
            got = np.asarray(found.get(name, np.nan))
            if got.shape != right.shape or got.dtype.kind == "c" or not judged(got, right, output.compare, "float64", output.order).passed:
                break
        else:
            return True
    return False


def prepared(port: ports.Port, golden: Golden) -> list[Asked]:
    """Every case of the port, the quickest first."""
    files = {f.__code__: f"{s.name}.{n}" for s in port.sources for n, f in s.functions.items()}
    found = []
    for case in golden.cases:
        if case.operation not in port.operations:
            continue
        ran: set[str] = set()

        def watch(frame, event, _):
            if event == "call" and frame.f_code in files:
                ran.add(files[frame.f_code])

        inputs = golden.inputs(case)
        port.answer(case.operation, inputs, case.settings)
        sys.setprofile(watch)
        port.answer(case.operation, inputs, case.settings)
        sys.setprofile(None)
        began = time.perf_counter()
        out = port.answer(case.operation, inputs, case.settings)
        seconds = time.perf_counter() - began
        good = tuple(n for n in case.outputs if n in out and passes(golden, case, (n,), out))
        found.append(Asked(case, inputs, good, frozenset(ran), seconds))
    return sorted(found, key=lambda one: one.seconds)


class TooLong(Exception):
    """A wrong version does not end."""


def _stop(*_):
    raise TooLong


def outcome(port: ports.Port, golden: Golden, asked: list[Asked]) -> tuple[str, str]:
    """("refused", case), ("error", case) if the first case raises, or ("passed", "")."""
    errors = 0
    for one in asked:
        signal.setitimer(signal.ITIMER_REAL, LIMIT)
        try:
            with np.errstate(all="ignore"):
                found = port.answer(one.case.operation, one.inputs, one.case.settings)
            good = passes(golden, one.case, one.passed, found)
        except TooLong:
            return "refused", one.case.name
        except Exception:  # the mutant computes nothing here
            errors += 1
            if errors == len(asked) or errors > 2:
                return "error", one.case.name
            continue
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        if not good:
            return "refused", one.case.name
    return ("error", asked[0].case.name) if errors else ("passed", "")


def surveyed(port: ports.Port, golden: Golden, only: str = "", skip=frozenset(), names=None) -> dict[str, list[str]]:
    """[kind, outcome, case] of every wrong version by its name."""
    asked, found, kills = prepared(port, golden), {}, Counter()
    for source in port.sources:
        if only and source.name != only:
            continue
        for function, mutant in wrong_versions(source):
            if mutant.name in skip or (names is not None and mutant.name not in names):
                continue
            cases = [one for one in asked if mutant.kernel in one.functions]
            if not cases:
                found[mutant.name] = [mutant.kind, "not asked", ""]
                continue
            cases.sort(key=lambda one: (one.seconds + 1e-4) / (1 + kills[mutant.kernel, one.case.name]))
            with in_place(function, mutant.code):
                result, case = outcome(port, golden, cases)
            kills[mutant.kernel, case] += result == "refused"
            found[mutant.name] = [mutant.kind, result, case]
    return found


def main(words: list[str]) -> int:
    """Survey a port and print the survivors and the rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("port", choices=("definition", "by_hand"))
    parser.add_argument("--only", default="", metavar="MODULE")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--golden", type=Path, default=golden_folder())
    options = parser.parse_args(words)
    signal.signal(signal.SIGALRM, _stop)
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
    began = time.monotonic()
    found = surveyed(getattr(ports, options.port)(), read_golden(options.golden, verify=False), options.only)
    if options.out:
        options.out.write_text(json.dumps(found, indent=0))
    for name, (kind, result, _) in found.items():
        if result == "passed":
            print(f"[{kind}] {name}")
    print(Counter(result for _, result, _ in found.values()), f"{time.monotonic() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
