"""The search: single changes of the definition against the outputs of a port, within a time limit."""

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from endotsr.errors import InputError
from endotsr.port.judge.format import Precision
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import Golden
from endotsr.port.judge.verdict import INSIDE, judge, left_out
from endotsr.port.operations.definition import definition_operations
from endotsr.port.search.cases import Answered
from endotsr.port.search.changes import SECONDS, search
from endotsr.port.search.trial import Hit, Trial
from endotsr.untrusted.names import counted

START_UP = 60.0  # seconds of a process outside its search
SLOWEST = 10.0  # elapsed seconds per second of computing on a busy machine
LONG = 3.0  # factor on the time of a search among trajectories
MOST_LINES = 3  # listed source lines, and functions with such lines beyond which nothing is said
MOST_APART = 6  # outputs that are explained one at a time


def explained(golden: Golden, outputs: Path, precision: Precision, level: int, name: str, seconds: float) -> Trial:
    """The search for the mistake of an operation with a refused output.

    Raises: InputError if the definition does not compute the operation, or none of its refused outputs can be compared:
    one may be unreadable, of another shape, or asked only to equal another output.
    """
    operation = definition_operations().get(name)
    if operation is None:
        raise InputError(f"{name}: not computed by the definition")
    cases = [case for case in golden.cases if case.operation == name and case.level <= level]
    reports = judge(golden._replace(cases=cases), outputs, precision, level=min(level, 4)).cases
    answered = [Answered(golden, *pair, outputs, precision) for pair in zip(cases, reports)]
    for one in answered:
        one.keep_reproduced(operation)
    answered = [one for one in answered if one.got]
    answered.sort(key=_order)
    if not answered or not answered[0].refused:
        raise InputError(f"{name}: nothing to explain")
    return search(operation, answered, golden, seconds * (LONG if answered[0].length else 1))


def together(trial: Trial, seconds: float) -> list[str]:
    """Two changes that explain every output together, if the likeliest one explains the forward outputs or most cases.

    The second one is searched for in the definition with the first one.
    """
    first = trial.hits[0] if trial.hits else None
    if first is None or first.standing is None or trial.length:
        return []
    if first.whole != "forward" and (first.whole != "most" or trial.discrete):
        return []  # many changes give the decisions of the one case that is left
    with first.standing():
        beside = sorted((one.beside(trial.operation) for one in trial.cases), key=_order)
        second = search(trial.operation, beside, trial.golden, seconds) if beside[0].refused else None
    said = _equally(second) if second and second.hits and second.hits[0].whole == "all" else []
    if not said:
        return []
    whole = f"  (together every output of its {counted(len(trial.cases), 'case')})"
    head = f"your outputs are those of the definition with two changes: {_said(first)}"
    return [head, f"  and {said[0]}", *said[1:], whole]


def apart(trial: Trial, whole: Sequence[str], seconds: float) -> list[str]:
    """Explanations of single outputs: independent mistakes may spoil different ones.

    whole   what `sentences` says of all outputs together

    Tried are refused outputs if no change explains them together, and the gradients if one explains the forward
    outputs alone; at most MOST_APART of them, and none of a trajectory. An output is compared together with the outputs
    that are right in all cases. Forward outputs come first; each has an equal part of the time that is left.
    """
    names = dict.fromkeys(name for one in trial.cases for name in _forward_first(one))
    left = list(names)
    if whole and trial.hits[0].whole == "forward":
        left = [name for name in names if any(name in one.gradient_names for one in trial.cases)]
    elif trial.hits:
        left = []
    if len(names) < 2 or any(one.length for one in trial.cases):
        return []
    found: dict[str, list[str]] = {}
    end, tried = time.process_time() + seconds, left[:MOST_APART]
    for k, name in enumerate(tried):
        cases = sorted((one.alone(name, names) for one in trial.cases), key=_order)
        budget = (end - time.process_time()) / (len(tried) - k)
        lines = _equally(search(trial.operation, cases, trial.golden, budget))
        for line in lines[:1]:
            found.setdefault(line, []).append(name)
    return [f"{', '.join(outputs)} alone: as in the definition with {line}" for line, outputs in found.items()]


def _forward_first(one: Answered) -> list[str]:
    """Refused outputs in the order of the definition, gradients last."""
    return [name for name in (*one.forward_names, *one.gradient_names) if name in one.refused]


def _order(one: Answered) -> tuple[bool, int, int, int]:
    """Sort key: refused cases first, short trajectories before long ones, then cases with the most to explain."""
    return not one.refused, one.length, -len(one.refused), -sum(one.got[name].size for name in one.refused)


def explain(golden: Golden, report: Report, outputs: Path, seconds: float = SECONDS) -> None:
    """Add to a report the results of a search for the mistake of its first wrong operation.

    The search runs in a separate process: a change may exhaust the memory or misuse a library.
    """
    if not report.first_wrong:
        return
    words = [golden.folder, outputs, report.precision, report.asked_level, report.first_wrong, seconds]
    limit = START_UP + SLOWEST * LONG * seconds
    with contextlib.suppress(subprocess.TimeoutExpired):
        done = subprocess.run([sys.executable, "-m", "endotsr.port.search", *map(str, words)],
                              capture_output=True, timeout=limit, check=False)  # fmt: skip
        if done.returncode == 0:
            found = json.loads(done.stdout)
            report.causes, report.inside = found["causes"], found["inside"]
            unasked = report.causes or INSIDE in left_out(outputs)[0]
            report.notes += [found["asked"]] if found["asked"] and not unasked else []


def sentences(trial: Trial) -> list[str]:
    """The changes that explain most and are likeliest, one per source line; nothing if they are in many functions."""
    said = _equally(trial)
    if not said:
        return []
    whole = f"  ({trial.hits[0].extent} of its {counted(len(trial.cases), 'case')})"
    return [f"your outputs are those of the definition with {said[0]}", *said[1:], whole]


def _said(hit: Hit) -> str:
    return f"{hit.text}{f': {hit.where}' if hit.where else ''}"


def _equally(trial: Trial) -> list[str]:
    """A likeliest change that explains most, and lines with those that are equally likely.

    One that explains another part of the outputs, such as those of the forward pass, is listed with that part.
    """
    best: dict[str, Hit] = {}
    for hit in trial.hits:
        if hit.rank[:3] == trial.hits[0].rank[:3]:
            best.setdefault(hit.where or hit.text, hit)
    functions = sorted({hit.function for hit in best.values()})
    if not best or len(functions) > MOST_LINES:
        return []
    said = [_said(hit) for hit in best.values()]
    first, *others = best.values()
    rest = [
        f"  or equally with {line}"
        if hit.whole == first.whole
        else f"  or with {line}, which gives {hit.extent.rstrip(',')}"
        for line, hit in zip(said[1:], others)
    ]
    if len(best) > MOST_LINES:
        said[0] = f"for example {said[0]}"
        rest = [f"  or equally with another change in {', '.join(functions)}: {len(best)} lines"]
    return [said[0], *rest]
