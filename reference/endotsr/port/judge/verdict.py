"""The judge: compares a folder of outputs with the golden cases. Every state of the folder has a verdict."""

import difflib
import os
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.port.judge.compare import Verdict, judged, misses
from endotsr.port.judge.diagnose import diagnosis, first_wrong
from endotsr.port.judge.format import BITS, LEVELS, Case, Output, Precision
from endotsr.port.judge.needles import Off, only_needles
from endotsr.port.judge.npy import Refused, read_plain, read_text
from endotsr.port.judge.profiles import (
    PROFILES,
    REVERSE,
    WITHOUT,
    Graded,
    ProfileClaim,
    claim_text,
    complete_level,
    last_level,
    of_profile,
    profile_claims,
    without_reverse,
)
from endotsr.port.judge.recognise import (
    NAMED,
    Evidence,
    Suspect,
    Taken,
    evidence_of,
    merged,
    pair_of,
    suspects_of,
)
from endotsr.port.judge.relate import relations
from endotsr.port.judge.store import Golden
from endotsr.port.judge.trajectory import FirstWrong, first_wrong_iteration

NOT_PORTED = "not_ported.txt"  # in the folder of outputs: operations omitted by the port, one per line
INSIDE = "inside"  # in that file: the port cannot write arrays inside its operations
NO_REVERSE = "reverse"  # in that file: the port has no reverse pass
FORWARD_ALONE = 1  # the last level without gradients that is followed by one with them
LARGEST_RELATED = 20_000  # largest number of entries of an output that is searched for relations
MISSING = "missing"  # the array reader's reason for a missing file
MOST_FILES = 1000  # files of a case's folder that are searched for a misnamed output
RESEMBLES = 0.6  # smallest similarity of two names, from 0 to 1

Status = Literal["passed", "refused", "missing", "not ported"]


class OutputReport(msgspec.Struct, kw_only=True):
    """Verdict on one output."""

    name: str
    level: int
    status: Status
    reason: str
    distance: float | None = None
    index: tuple[int, ...] = ()
    got: float | None = None
    expected: float | None = None
    forms: list[str] = []
    """relations to the expected array, satisfied to the tolerance, the most specific first"""


class CaseReport(msgspec.Struct, kw_only=True):
    """Verdict on one case."""

    name: str
    title: str
    operation: str = ""
    """empty for the comparison of two runs"""
    options: tuple[str, ...] = ()
    """operations of the options that the case uses"""
    level: int
    status: Status
    outputs: list[OutputReport] = []
    looks_like: list[str] = []
    """mistakes that explain the refusals of this case, best first"""
    made_for: list[str] = []
    answer: int = 0
    """the one of several legal answers with which it was compared"""
    first_wrong: str = ""
    """of a trajectory: the first wrong iteration, its wrong outputs, and the place to look at"""
    events: list[str] = []
    """events at this iteration or the one before"""
    evidence: dict[str, Evidence] = {}
    """by mistake; not part of the JSON report, whose suspects have the sums"""


class Report(msgspec.Struct, kw_only=True):
    """The report of the judge."""

    version: str
    precision: str
    asked_level: int
    level: int
    """highest level that is complete, -1 = none; also of a port that fails"""
    without: tuple[str, ...]
    """operations that the port declares as omitted"""
    claim: str
    levels: dict[int, tuple[int, int]]
    """passed and requested outputs by level"""
    cases: list[CaseReport]
    suspects: list[Suspect]
    notes: list[str]
    pair: tuple[str, ...] = ()
    """two known mistakes that together explain every refused output, if none does alone"""
    diagnosis: list[str] = []
    """the first wrong operation and the relations of its outputs to the expected ones; empty if nothing is refused"""
    causes: list[str] = []
    """changes of the definition that reproduce the port's outputs of that operation; see port.search"""
    inside: list[str] = []
    """the first wrong array inside that operation, among the port's intermediate arrays; see port.search.inside"""
    needles: list[str] = []
    """if needles alone are wrong: how far, and how to mend it"""
    failures: list[str] = []
    """failures of the port as a program"""
    profile: str = ""
    """the profile that was asked for, "" = every case"""
    profiles: list[ProfileClaim] = []
    """what is right, by profile"""
    seconds: float = 0.0
    """of the calls of the port"""
    runs: int = 1
    """calls of the port that were judged; the second call of level 5 belongs to the first"""

    first_wrong: str = ""
    """the first operation with a refused output"""

    @property
    def passed(self) -> bool:
        """Whether the requested level is complete."""
        return self.level >= self.asked_level

    @property
    def accepted(self) -> bool:
        """Whether no judged case is refused or missing, as asked of a part, and the port itself did not fail."""
        return not self.failures and all(case.status in ("passed", "not ported") for case in self.cases)


def judge(
    golden: Golden, outputs: Path, precision: Precision, *, level: int = 5, again: Path | None = None, only: str = "",
    profile: str = "",
) -> Report:  # fmt: skip
    """Compare OUTDIR/<family>/<case>/<name>.npy with the golden cases up to a level.

    again     a second output folder of the same port, bitwise equal; without it level 5 is not complete
    only      a family, or family/case: no other case is judged, and there is no claim
    profile   one of `profiles.PROFILES`: only its outputs are judged, up to its last level
    """
    golden, level = asked_of(golden, only, profile, level)
    without, notes = declared(golden, outputs)
    forward = not profile and NO_REVERSE in left_out(outputs)[0]
    golden = without_reverse(golden) if forward else golden
    reports = [
        CaseReport(**_head(case), status="not ported")
        if case.parts & set(without)
        else judge_case(golden, case, outputs, precision, level)
        for case in golden.cases
        if case.level <= level
    ]
    if level >= BITS and (again or not only):  # a part has no claim, and so needs no second run
        reports.append(_not_repeated() if again is None else _repeated(golden, outputs, again, without))
    report = conclude(golden, reports, precision, level, notes, without, profile)
    if forward and not only and level > FORWARD_ALONE:
        report.notes.append(_forward_note(without))
    if only:
        report.claim, report.profiles = f"no claim: only {only} was judged", []
    elif forward and report.level >= 0:
        report.profiles = profile_claims(
            [*_graded(reports), *(Graded(r.operation, REVERSE, 2, False) for r in reports)]
        )
        report.claim += f"{', ' if WITHOUT in report.claim else WITHOUT}reverse passes"
    return report


def _forward_note(without: tuple[str, ...]) -> str:
    """Why a port without reverse passes has level 1 at most, and the profile that judges the rest of it."""
    named = [n for n, one in PROFILES.items() if one.forward and not set(one.operations) & set(without)]
    more = [f"--profile {name} judges its part up to level {last_level(name)}" for name in named]
    alone = f"level {FORWARD_ALONE + 1} asks for gradients, so that a claim of every operation ends at {FORWARD_ALONE}"
    return "; ".join([f"{NOT_PORTED}: without reverse passes, {alone}", *more])


def asked_of(golden: Golden, only: str, profile: str, level: int) -> tuple[Golden, int]:
    """The cases of a part or a profile, and the level up to which they are asked. Raises InputError if unknown.

    In a profile, it is the highest level up to `level` at which the profile has an output.
    """
    golden = only_of(golden, only)
    if not profile:
        return golden, level
    cases = of_profile(golden.cases, profile)
    if not cases:
        raise InputError(f"--profile {profile}: {only} is no part of it")
    highest = min(level, last_level(profile))
    own = {output.level for case in cases for output in case.outputs.values()} | {BITS}
    return golden._replace(cases=cases), max((k for k in own if k <= highest), default=highest)


def only_of(golden: Golden, only: str) -> Golden:
    """The cases of one family, or one family/case. Raises InputError if there is none."""
    cases = [case for case in golden.cases if only in ("", case.family, case.name)]
    if not cases:
        raise InputError(
            f"--only {only[:60]!a}: no such case; allowed: {', '.join(golden.manifest.families)}, or FAMILY/CASE"
        )
    return golden._replace(cases=cases)


def declared(golden: Golden, outputs: Path) -> tuple[tuple[str, ...], list[str]]:
    """Operations listed in the port's file NOT_PORTED, and notes on its invalid entries."""
    named, refusal = left_out(outputs)
    if refusal:
        return (), [f"{NOT_PORTED}: {refusal}; every operation is judged"]
    known = dict.fromkeys(case.operation for case in golden.cases)
    unknown = [f"{NOT_PORTED}: no operation {name[:40]!a}" for name in sorted(named - {*known, INSIDE, NO_REVERSE})]
    return tuple(name for name in known if name in named), unknown[:5]


def left_out(outputs: Path) -> tuple[set[str], str]:
    """The words of the port's file NOT_PORTED, empty without it, and the reason if it is unreadable."""
    try:
        lines = read_text(outputs / NOT_PORTED, outputs).splitlines()
    except Refused as refusal:
        return set(), "" if str(refusal) == MISSING else str(refusal)
    return {line.split("#")[0].strip() for line in lines} - {""}, ""


def conclude(
    golden: Golden, reports: list[CaseReport], precision: Precision, level: int, notes: list[str],
    without: tuple[str, ...] = (), profile: str = "",
) -> Report:  # fmt: skip
    """Levels, claims and suspects from the verdicts on all cases. An empty level is complete in a profile alone."""
    counts = {k: _count(reports, k) for k in LEVELS if k <= level}
    reached = complete_level(counts, gaps=bool(profile))
    _, first = first_wrong(golden.cases, reports)
    evidence = merged(r.evidence for r in reports)
    suspects = suspects_of(golden, evidence)
    pair = None if any(one.named for one in suspects) else pair_of(evidence)
    return Report(
        version=golden.manifest.version, precision=precision, asked_level=level, level=reached, without=without,
        claim=_claim(golden, reached, precision, without, profile), levels=counts, cases=reports,
        suspects=suspects, notes=notes, pair=(pair.first, pair.second) if pair else (),
        diagnosis=diagnosis(golden.cases, reports), first_wrong=first.operation if first else "",
        needles=only_needles(_off(golden, reports, precision)), profile=profile,
        profiles=[one for one in profile_claims(_graded(reports)) if profile in ("", one.profile)],
    )  # fmt: skip


def _graded(reports: list[CaseReport]) -> list[Graded]:
    """Every verdict for the profiles; one that fails for an operation that the port leaves out."""
    found = [
        Graded(r.operation or "determinism", o.name, o.level, o.status == "passed", r.options)
        for r in reports
        for o in r.outputs
    ]
    return found + [Graded(r.operation, "", r.level, False, r.options) for r in reports if not r.outputs]


def _off(golden: Golden, reports: list[CaseReport], precision: Precision) -> list[Off]:
    """Every output that is not right, with its distance in tolerances."""
    cases, found = {case.name: case for case in golden.cases}, []
    for report in reports:
        for output in (o for o in report.outputs if o.status != "passed"):
            asked = cases[report.name].outputs.get(output.name) if report.name in cases else None
            tolerance = getattr(asked.compare, precision) if asked else 0.0
            ratio = output.distance / tolerance if tolerance and output.distance is not None else None
            found.append(Off(report.name, output.name, ratio))
    return found


def without_claim(report: Report, reasons: list[str]) -> None:
    """Remove the claim: a port that fails has none, even if it wrote outputs before."""
    report.failures += reasons
    report.level, report.claim, report.profiles = -1, f"no claim: {'; '.join(dict.fromkeys(reasons))}", []


def _claim(golden: Golden, reached: int, precision: Precision, without: tuple[str, ...], profile: str) -> str:
    """The claim that the port may publish, with the operations that it omits from these levels."""
    if reached < 0:
        return "no level is complete"
    asked = {case.operation for case in golden.cases if case.level <= reached}
    return claim_text(golden.manifest.version, profile, reached, precision, [n for n in without if n in asked])


def _count(reports: list[CaseReport], level: int) -> tuple[int, int]:
    all_of = [o for r in reports for o in r.outputs if o.level == level]
    return sum(o.status == "passed" for o in all_of), len(all_of)


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
        **_head(case), status=_together(found), outputs=found,
        looks_like=sorted(scores, key=lambda flag: (-scores[flag], -len(evidence[flag].agrees))),
        made_for=list(case.flags), answer=best, first_wrong=where.text, events=where.events, evidence=evidence,
    )  # fmt: skip


def _head(case: Case) -> dict[str, Any]:
    """The fields of a report that are those of its case."""
    return {name: getattr(case, name) for name in ("name", "title", "operation", "options", "level")}


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


def _together(found: list[OutputReport]) -> Status:
    kinds = {o.status for o in found}
    return "refused" if "refused" in kinds else "missing" if "missing" in kinds else "passed"


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


def _not_repeated() -> CaseReport:
    """The report without a second run: level 5 is not complete."""
    reason = "no second run: give it with --again"
    return _again([OutputReport(name="second run", level=5, status="missing", reason=reason)])


def _repeated(golden: Golden, first: Path, second: Path, without: tuple[str, ...]) -> CaseReport:
    """Bitwise comparison of all outputs of two runs."""
    found = []
    for case in golden.cases:
        if case.parts & set(without):
            continue
        for name, asked in case.outputs.items():
            files = [folder / case.family / case.case / f"{name}.npy" for folder in (first, second)]
            limit = 8 * max(int(np.prod(asked.shape)), 1)
            try:
                a, b = (read_plain(path, root, limit) for path, root in zip(files, (first, second)))
                same = a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
                status, reason = ("passed", "same bits") if same else ("refused", "other bits in the second run")
            except Refused as refusal:
                status, reason = "missing", str(refusal)
            report = OutputReport(name=f"{case.name}/{name}", level=5, status=status, reason=reason)  # type: ignore[arg-type]
            found.append(report)
    return _again(found)


def _again(found: list[OutputReport]) -> CaseReport:
    return CaseReport(
        name="determinism/again", title="A second run gives the same bits", level=5, status=_together(found),
        outputs=found, made_for=["sums_in_any_order"],
    )  # fmt: skip
