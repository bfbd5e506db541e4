"""Whether two runs of a port give the same bits, which level 5 asks for."""

from pathlib import Path

import numpy as np

from endotsr.port.judge.case_verdict import together
from endotsr.port.judge.npy import Refused, read_plain
from endotsr.port.judge.records import CaseReport, OutputReport, Status
from endotsr.port.judge.store import Golden

SAME: tuple[Status, str] = ("passed", "same bits")
OTHER: tuple[Status, str] = ("refused", "other bits in the second run")


def not_repeated() -> CaseReport:
    """The report without a second run: level 5 is not complete."""
    reason = "no second run: give it with --again"
    return _again([OutputReport(name="second run", level=5, status="missing", reason=reason)])


def repeated(golden: Golden, first: Path, second: Path, without: tuple[str, ...]) -> CaseReport:
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
                status, reason = SAME if same else OTHER
            except Refused as refusal:
                status, reason = ("missing", str(refusal))
            report = OutputReport(name=f"{case.name}/{name}", level=5, status=status, reason=reason)
            found.append(report)
    return _again(found)


def _again(found: list[OutputReport]) -> CaseReport:
    return CaseReport(
        name="determinism/again", title="A second run gives the same bits", level=5, status=together(found),
        outputs=found, made_for=["sums_in_any_order"],
    )  # fmt: skip
