"""The verdict on one case: its outputs against the expected ones, whatever a port has written."""

import difflib
import os
from itertools import islice
from pathlib import Path
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.compare import Verdict, judged, misses
from endotsr.port.judge.format import Case, Output, Precision
from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.recognise import NAMED, Taken, evidence_of
from endotsr.port.judge.records import CaseReport, OutputReport, Status
from endotsr.port.judge.relate import relations
from endotsr.port.judge.store import Golden
from endotsr.port.judge.trajectory import FirstWrong, first_wrong_iteration

LARGEST_RELATED = 20_000  # largest number of entries of an output that is searched for relations
MISSING = "missing"  # the array reader's reason for a missing file
MOST_FILES = 1000  # files of a case's folder that are searched for a misnamed output
RESEMBLES = 0.6  # smallest similarity of two names, from 0 to 1


class CaseHead(TypedDict):
    """The fields of a `CaseReport` that are those of its case."""

    name: str
    title: str
    operation: str
    options: tuple[str, ...]
    level: int


def judge_case(golden: Golden, case: Case, outputs: Path, precision: Precision, level: int = 5) -> CaseReport:
    """The verdict on one case; never raises for any content of `outputs`."""
    folder = outputs / case.family / case.case
    taken: dict[str, NDArray | Refused] = {}
    for name, asked in case.outputs.items():
        if asked.level <= level:
            try:
                taken[name] = _taken(folder / f"{name}.npy", outputs, asked, precision)
            except Refused as refusal:
                taken[name] = refusal
    _name_strays(folder, taken)
    tries = [_held_against(golden, case, taken, precision, answer) for answer in range(case.answers)]
    best = min(range(case.answers), key=lambda k: misses((o.level, o.status == "passed") for o in tries[k][0]))
    found, seen = tries[best]
    _relate(golden, case, found, seen, precision)
    evidence = evidence_of(case, seen, precision)
    where = _first_wrong(case, found)
    scores = {flag: one.score for flag, one in evidence.items() if one.score >= NAMED}
    return CaseReport(
        **head_of(case), status=together(found), outputs=found,
        looks_like=sorted(scores, key=lambda flag: (-scores[flag], -len(evidence[flag].agrees))),
        made_for=list(case.flags), answer=best, first_wrong=where.text, events=where.events, evidence=evidence,
    )  # fmt: skip


def head_of(case: Case) -> CaseHead:
    """The fields of a report that are those of its case."""
    return CaseHead(name=case.name, title=case.title, operation=case.operation, options=case.options, level=case.level)


def together(found: list[OutputReport]) -> Status:
    """The worst status of the outputs of a case."""
    kinds = {o.status for o in found}
    return "refused" if "refused" in kinds else "missing" if "missing" in kinds else "passed"


def _name_strays(folder: Path, taken: dict[str, NDArray | Refused]) -> None:
    """Add to each missing output a similarly named file of its folder that is not an output."""
    missing = [name for name, got in taken.items() if isinstance(got, Refused) and str(got) == MISSING]
    try:
        files = [entry.name for entry in islice(os.scandir(folder), MOST_FILES)] if missing else []
    except OSError:
        return
    strays = [name.removesuffix(".npy") for name in sorted(files) if name.removesuffix(".npy") not in taken]
    for name in missing:
        for stray in difflib.get_close_matches(name, strays, 1, RESEMBLES):
            taken[name] = Refused(f"{MISSING}; {f'{stray}.npy'[:60]!a} is there and is no output of this case")


def _relate(
    golden: Golden, case: Case, found: list[OutputReport], seen: dict[str, Taken], precision: Precision
) -> None:
    """Record the relations of the refused outputs."""
    refused = [(o, seen[o.name]) for o in found if o.status == "refused" and seen[o.name].got is not None]
    if not refused:
        return
    others = golden.inputs(case) | {name: one.expected for name, one in seen.items()}
    for output, taken in refused:
        rule, got = case.outputs[output.name].compare, taken.got
        if got is None or rule.kind == "identical" or got.size > LARGEST_RELATED:
            continue
        tolerance = rule.float64 if precision == "float64" else rule.float32
        rest = {name: array for name, array in others.items() if name != output.name}
        output.forms = [r.text for r in relations(got, taken.expected, rule.scale, tolerance, rest)]


def _held_against(
    golden: Golden, case: Case, taken: dict[str, NDArray | Refused], precision: Precision, answer: int
) -> tuple[list[OutputReport], dict[str, Taken]]:
    """Verdicts on all outputs against one of the legal answers, and the outputs as evidence of mistakes."""
    found: list[OutputReport] = []
    seen: dict[str, Taken] = {}
    for name, got in taken.items():
        asked = case.outputs[name]
        expected = golden.array(case, asked.answer(answer))
        if isinstance(got, Refused):
            status: Status = "missing" if str(got).startswith(MISSING) else "refused"
            found.append(OutputReport(name=name, level=asked.level, status=status, reason=str(got)))
            seen[name] = Taken(status, None, expected)
            continue
        verdict = judged(got, expected, asked.compare, precision, asked.order)
        if verdict.passed and asked.compare.kind == "identical":
            verdict = _identical(got, taken.get(asked.compare.to), asked.compare.to)
        found.append(_report(name, asked, verdict))
        seen[name] = Taken(found[-1].status, got, expected)
    return found, seen


def _first_wrong(case: Case, found: list[OutputReport]) -> FirstWrong:
    """The first wrong iteration of a trajectory."""
    along = [o for o in found if case.outputs[o.name].order == "iteration"]
    wrong = {o.name: o.index[0] + 1 for o in along if o.index}
    absent = [o.name for o in along if o.status != "passed" and not o.index]
    return first_wrong_iteration(wrong, [o.name for o in along], case.settings, absent)


def _taken(path: Path, root: Path, asked: Output, precision: Precision) -> NDArray:
    """The output as an array of the requested shape and kind. Raises Refused."""
    count = int(np.prod(asked.shape))
    got = read_plain(path, root, largest=8 * max(count, 1))
    if got.shape != asked.shape:
        raise Refused(f"shape {got.shape}; expected {asked.shape}")
    kinds = {"real": "f", "integer": "iu", "boolean": "bu"}[asked.dtype]
    if got.dtype.kind not in kinds:
        raise Refused(f"dtype {got.dtype}; expected {asked.dtype}")
    if asked.dtype == "real" and precision == "float64" and got.dtype.itemsize < 8:
        raise Refused(f"dtype {got.dtype}; expected float64")
    return got


def _identical(got: NDArray, other: NDArray | Refused | None, name: str) -> Verdict:
    """Whether an output has the bits of another one; if not, with the first entry that differs."""
    if not isinstance(other, np.ndarray):
        return Verdict(False, f"{name}, whose bits it must have, is not there", 0.0, (), np.nan, np.nan)
    if other.dtype != got.dtype or other.shape != got.shape:
        reason = f"{got.dtype} {got.shape}; {name} is {other.dtype} {other.shape}"
        return Verdict(False, reason, 0.0, (), np.nan, np.nan)
    bits = [np.ascontiguousarray(a).reshape(-1).view(np.uint8).reshape(a.size, -1) for a in (got, other)]
    unequal = np.flatnonzero((bits[0] != bits[1]).any(axis=1))
    if not unequal.size:
        return Verdict(True, "same bits", 0.0)
    worst = tuple(int(k) for k in np.unravel_index(int(unequal[0]), got.shape))
    return Verdict(False, f"bits differ from {name}", 0.0, worst, float(got[worst]), float(other[worst]))


def _report(name: str, asked: Output, verdict: Verdict) -> OutputReport:
    shown = {} if verdict.passed or not verdict.reason else {
        "index": verdict.worst, "got": _plain(verdict.got), "expected": _plain(verdict.expected)
    }  # fmt: skip
    status: Status = "passed" if verdict.passed else "refused"
    return OutputReport(
        name=name, level=asked.level, status=status, reason=verdict.reason, distance=verdict.distance, **shown
    )


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
