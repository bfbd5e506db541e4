"""Ports in Python: one pytest test per case, with the port's own file of known failures."""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.port.judge.case_verdict import judge_case
from endotsr.port.judge.format import Case, Precision
from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.records import CaseReport
from endotsr.port.judge.store import Golden, golden_folder, in_precision, read_golden

Answer = Callable[[str, dict[str, NDArray], dict[str, Any]], Mapping[str, NDArray | float] | None]


def golden_test(
    answer: Answer,
    *,
    precision: Precision = "float32",
    level: int = 5,
    known_failures: str | Path | None = None,
    golden: Path | None = None,
):
    """A parametrised test function; assign it to a name that begins with `test`.

    answer          (operation, inputs, settings) -> outputs by name; None skips an operation that is not ported.
                    Inputs are in the requested precision and may be modified
    known_failures  text file of the port, one family/case per line; a listed case must fail
    Raises:         InputError if the golden folder is invalid or a listed case does not exist.
    """
    import pytest

    target = read_golden(golden_folder(golden))
    cases = [case for case in target.cases if case.level <= level]
    known = known_of(known_failures, {case.name for case in target.cases})
    marks = {True: [pytest.mark.xfail(strict=True, reason="known failure of the port")], False: []}

    @pytest.mark.parametrize("case", [pytest.param(c, id=c.name, marks=marks[c.name in known]) for c in cases])
    def test_golden(case: Case) -> None:
        report = answered(target, case, answer, precision, level)
        if report is None:
            pytest.skip(f"operation {case.operation} is not ported")
        if report.status != "passed":
            pytest.fail(explain(report), pytrace=False)

    return test_golden


def answered(golden: Golden, case: Case, answer: Answer, precision: Precision, level: int) -> CaseReport | None:
    """The verdict on a port's answer to one case; None if the operation is not ported."""
    found = answer(case.operation, in_precision(golden.inputs(case), precision), dict(case.settings))
    if found is None:
        return None
    with tempfile.TemporaryDirectory() as scratch:
        for name in case.outputs:
            if name in found:
                write_npy(Path(scratch) / case.name / f"{name}.npy", np.asarray(found[name]))
        return judge_case(golden, case, Path(scratch), precision, level)


def explain(report: CaseReport) -> str:
    """Title, refused outputs, the mistakes that they resemble, and the mistakes targeted by the case."""
    lines = [f"{report.name}: {report.title}"]
    lines += [f"  {o.name}: {o.reason} {list(o.index) or ''}" for o in report.outputs if o.status != "passed"]
    if report.looks_like:
        return "\n".join([*lines, f"  looks like {', '.join(report.looks_like)}"])
    return "\n".join([*lines, f"  made for {', '.join(report.made_for)}"] if report.made_for else lines)


def known_of(file: str | Path | None, names: set[str]) -> set[str]:
    """The cases that a file of known failures lists. Raises: InputError for an unreadable file or an unknown case."""
    if file is None:
        return set()
    try:
        lines = [line.split("#")[0].strip() for line in Path(file).read_text(encoding="utf-8").splitlines()]
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not UTF-8 text") from None
    listed = {line for line in lines if line}
    if listed - names:
        raise InputError(f"{file}: no such case: {', '.join(sorted(listed - names))}")
    return listed
