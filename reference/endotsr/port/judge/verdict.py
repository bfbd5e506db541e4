"""The judge: compares a folder of outputs with the golden cases. Every state of the folder has a verdict."""

from pathlib import Path

from endotsr.errors import InputError
from endotsr.port.judge.case_verdict import MISSING, head_of, judge_case
from endotsr.port.judge.diagnose import diagnosis, first_wrong
from endotsr.port.judge.format import BITS, LEVELS, Precision
from endotsr.port.judge.needles import Off, only_needles
from endotsr.port.judge.npy import Refused, read_text
from endotsr.port.judge.profiles import (
    PROFILES,
    REVERSE,
    WITHOUT,
    Graded,
    claim_text,
    complete_level,
    last_level,
    of_profile,
    profile_claims,
    without_reverse,
)
from endotsr.port.judge.recognise import merged, pair_of, suspects_of
from endotsr.port.judge.records import CaseReport, Report
from endotsr.port.judge.second_run import not_repeated, repeated
from endotsr.port.judge.store import Golden
from endotsr.untrusted.names import choice

NOT_PORTED = "not_ported.txt"  # in the folder of outputs: operations omitted by the port, one per line
INSIDE = "inside"  # in that file: the port cannot write arrays inside its operations
NO_REVERSE = "reverse"  # in that file: the port has no reverse pass
FORWARD_ALONE = 1  # the last level without gradients that is followed by one with them


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
        CaseReport(**head_of(case), status="not ported")
        if case.parts & set(without)
        else judge_case(golden, case, outputs, precision, level)
        for case in golden.cases
        if case.level <= level
    ]
    if level >= BITS and (again or not only):  # a part has no claim, and so needs no second run
        reports.append(not_repeated() if again is None else repeated(golden, outputs, again, without))
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
        raise InputError(f"--only {only[:60]!a}: no such case; use {choice(golden.manifest.families)}, or FAMILY/CASE")
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
