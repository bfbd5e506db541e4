"""A finding: what is wrong where, why it matters, and how to mend it."""

from typing import Literal, NamedTuple

Level = Literal["refusal", "warning", "note"]


class Finding(NamedTuple):
    """One thing that a check found. A refusal is what `endotsr train` refuses as well."""

    level: Level
    code: str  # a short name, the same in every version: `black-frame`
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


def worst_first(findings: list[Finding]) -> list[Finding]:
    """Refusals, then warnings, then notes; each in the order found."""
    order = {"refusal": 0, "warning": 1, "note": 2}
    return sorted(findings, key=lambda finding: order[finding.level])
