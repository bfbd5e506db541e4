"""Ports in Python without pytest: a TestCase of unittest with one test per case."""

import re
import unittest
from pathlib import Path

from endotsr.port.judge.format import Case, Precision
from endotsr.port.judge.pytest_cases import Answer, answered, explain, known_of
from endotsr.port.judge.store import golden_folder, read_golden


def golden_test_case(
    answer: Answer,
    *,
    precision: Precision = "float32",
    level: int = 5,
    known_failures: str | Path | None = None,
    golden: Path | None = None,
) -> type[unittest.TestCase]:
    """A class with a method `test_<family>_<case>` for each case; assign it to a name of the test module.

    answer, known_failures   as in `pytest_cases.golden_test`
    Raises: InputError if the golden folder is invalid or a listed case does not exist.
    """
    target = read_golden(golden_folder(golden))
    known = known_of(known_failures, {case.name for case in target.cases})

    def test_of(case: Case):
        def test(self: unittest.TestCase) -> None:
            report = answered(target, case, answer, precision, level)
            if report is None:
                self.skipTest(f"operation {case.operation} is not ported")
            elif report.status != "passed":
                self.fail(explain(report))

        test.__doc__ = f"{case.name}: {case.title}"
        return unittest.expectedFailure(test) if case.name in known else test

    tests = {f"test_{re.sub(r'[^0-9A-Za-z]', '_', c.name)}": test_of(c) for c in target.cases if c.level <= level}
    return type("GoldenCases", (unittest.TestCase,), {"__doc__": "One test per golden case.", **tests})
