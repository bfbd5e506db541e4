"""Several runs of a port whose sums depend on the order of threads: each within tolerance, not each with the same bits.

In: a port's command and a number of runs. Out: the report of the worst run, with what differs between the runs. Level 5
asks for equal bits and is not for such a port; one run of level 4 does not see a race that a later run shows.
"""

import shutil
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.port.judge.call import called
from endotsr.port.judge.command import KEPT, run_port
from endotsr.port.judge.compare import largest
from endotsr.port.judge.format import BITS, MOST_RUNS, Case, Precision
from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import Golden
from endotsr.port.judge.verdict import asked_of, judge, without_claim


class RunDifference(NamedTuple):
    """Outputs whose bits differ between two runs."""

    outputs: frozenset[str]  # case/output
    most: float  # largest difference, in tolerances
    where: str  # its output


def called_often(
    golden: Golden, port: str, root: Path, precision: Precision, *, runs: int, level: int, only: str = "",
    timeout: float = 600.0, profile: str = "",
) -> tuple[Report, Path]:  # fmt: skip
    """Call the port `runs` times and judge each run. Returns the report of the worst run and the first outputs.

    A level is complete if it is complete in every run. The report has a line for what differs between the runs.
    Raises: InputError as `called`, and for a number of runs or a level that cannot be asked.
    """
    if not 2 <= runs <= MOST_RUNS:
        raise InputError(f"--runs {runs}; use 1 to {MOST_RUNS}")
    if level >= BITS and not profile:
        raise InputError("--runs: level 5 asks for the same bits; give --level 4 or less")
    level = min(asked_of(golden, only, profile, level)[1], BITS - 1)
    worst, first = called(golden, port, root, precision, level=level, only=only, timeout=timeout, profile=profile)
    seconds, spread, wrong = worst.seconds, RunDifference(frozenset(), 0.0, ""), [] if worst.accepted else [1]
    second = root / KEPT[2]
    for number in range(2, runs + 1):
        shutil.rmtree(second, ignore_errors=True)
        began = time.monotonic()
        note = run_port(port, root / KEPT[0], second, timeout)
        seconds += time.monotonic() - began
        report = judge(golden, second, precision, level=level, only=only, profile=profile)
        if note:
            without_claim(report, [f"run {number}: {note}"])
        wrong += [] if report.accepted else [number]
        worst = min(worst, report, key=lambda one: (one.accepted, one.level, _right(one)))
        spread = joined(spread, spread_of(golden, first, second, precision, level))
    worst.seconds, worst.runs = seconds, runs
    worst.notes += lines(runs, wrong, spread)
    return worst, first


def _right(report: Report) -> int:
    return sum(o.status == "passed" for case in report.cases for o in case.outputs)


def joined(one: RunDifference, other: RunDifference) -> RunDifference:
    further = max(one, other, key=lambda spread: (spread.most, bool(spread.where)))
    return RunDifference(one.outputs | other.outputs, further.most, further.where)


def spread_of(golden: Golden, first: Path, second: Path, precision: Precision, level: int) -> RunDifference:
    """What differs between two folders of outputs; an output that is missing in one is left to the verdicts."""
    changed, most, where = set(), 0.0, ""
    for case in (one for one in golden.cases if one.level <= level):
        for name in (name for name, output in case.outputs.items() if output.level <= level):
            pair = [_array(folder, case, name) for folder in (first, second)]
            if pair[0] is None or pair[1] is None or pair[0].tobytes() == pair[1].tobytes():
                continue
            changed.add(f"{case.name}/{name}")
            rule = case.outputs[name].compare
            tolerance = getattr(rule, precision)
            kind = rule.scale if tolerance else "max"
            expected = golden.array(case, case.outputs[name].file)
            apart = _apart(pair[0], pair[1], expected, kind) / tolerance if tolerance else np.inf
            if apart >= most:
                most, where = apart, f"{case.name}/{name}"
    return RunDifference(frozenset(changed), most, where)


def _apart(one: NDArray, other: NDArray, expected: NDArray, kind: str) -> float:
    """The largest difference of two runs in units of the scale of the expected array."""
    if one.shape != expected.shape or other.shape != expected.shape:
        return np.inf
    moved = expected.astype(np.float64) + (one.astype(np.float64) - other.astype(np.float64))
    return largest(moved, expected, kind)


def _array(folder: Path, case: Case, name: str) -> NDArray | None:
    """An output of a run; None if it is missing or no plain array."""
    limit = 8 * max(int(np.prod(case.outputs[name].shape)), 1)
    try:
        return read_plain(folder / case.name / f"{name}.npy", folder, limit)
    except Refused:
        return None


def lines(runs: int, wrong: list[int], spread: RunDifference) -> list[str]:
    """What the runs have in common, for the report."""
    if wrong:
        some = ", ".join(map(str, wrong[:10])) + (" and others" if len(wrong) > 10 else "")
        opening = f"{len(wrong)} of {runs} runs are wrong ({some}); the report is that of the worst one"
    else:
        opening = f"every output is within its tolerance in each of {runs} runs"
    if not spread.outputs:
        return [f"{opening}; all runs have the same bits"]
    size = "a decision differs" if np.isinf(spread.most) else f"{spread.most:.2g} of the tolerance at most"
    return [f"{opening}; {len(spread.outputs)} outputs have other bits in another run, {size} ({spread.where})"]
