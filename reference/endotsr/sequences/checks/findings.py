"""A finding: what is wrong where, why it matters, and how to mend it."""

from typing import NamedTuple

from endotsr.sequences.checks.kinds import KINDS, Level


class Finding(NamedTuple):
    """One thing that a check found."""

    level: Level
    code: str  # key of `KINDS`
    where: str  # file or folder
    frame: int | None  # number within the sequence, from 0
    what: str
    why: str
    remedy: str

    @property
    def line(self) -> str:
        """The finding in one line."""
        place = f"{self.where}, frame {self.frame}" if self.frame is not None else self.where
        return f"{place}: {self.what}; {self.why}; {self.remedy}"


def finding(code: str, where: object, what: str, frame: int | None = None) -> Finding:
    """A finding of a kind of `KINDS`, at a file or folder and, where it concerns one, a frame."""
    kind = KINDS[code]
    return Finding(kind.level, code, str(where), frame, what, kind.why, kind.remedy)


def worst_first(findings: list[Finding]) -> list[Finding]:
    """Refusals, then warnings, then notes; each in the order found."""
    order = {"refusal": 0, "warning": 1, "note": 2}
    return sorted(findings, key=lambda found: order[found.level])
