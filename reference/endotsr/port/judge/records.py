"""The structures of a report: the verdicts on outputs, on cases, and on a folder of outputs."""

from typing import Literal

import msgspec

from endotsr.port.judge.profiles import ProfileClaim
from endotsr.port.judge.recognise import Evidence, Suspect

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
