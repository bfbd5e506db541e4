"""What is said of the first wrong operation holds: outputs that are not there are not called right."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_up_ports import case_of

from endotsr.port.judge.diagnose import diagnosis
from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.profiles import Graded, profile_claims
from endotsr.port.judge.trajectory import first_wrong_iteration
from endotsr.port.judge.verdict import judge

CASE: Any = SimpleNamespace(name="pose/one", operation="pose", equation="B16", title="one")
TWO = {"rotation": "passed", "d_rotation": "refused", "d_translation": "refused"}


def first_line(**status):
    outputs = [SimpleNamespace(name=n, status=s, level=2, forms=[]) for n, s in status.items()]
    report = SimpleNamespace(name=CASE.name, outputs=outputs, first_wrong="", events=[])
    return diagnosis([CASE], [report])[0].partition("level 2, ")[2]


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (TWO, "reverse alone; its forward outputs are right"),
        (TWO | {"rotation": "missing"}, "reverse alone; no forward output is refused"),
        ({"d_a": "refused", "d_b": "refused"}, "reverse alone"),
        ({"a": "refused", "b": "passed"}, "a alone; its other outputs are right"),
        ({"a": "refused", "b": "missing", "c": "passed"}, "a alone; no other output is refused"),
        ({"a": "refused"}, "forward"),
        ({"a": "refused", "d_a": "refused"}, "forward and reverse"),
    ],
)
def test_only_outputs_that_passed_are_called_right(status, said):
    assert first_line(**status) == said


def test_parts_of_an_iteration_that_are_missing_are_not_called_right(golden, tmp_path):
    case = case_of(golden, "training/twenty_iterations")
    for name, asked in case.outputs.items():
        value = np.array(golden.array(case, asked.file))
        if name == "square_position":
            value[8:] *= 1.01
        if not name.startswith("term_") and name != "loss":
            write_npy(tmp_path / case.name / f"{name}.npy", value[:-1] if name == "visits" else value)
    (report,) = judge(golden, tmp_path, "float64", level=4, only=case.name).cases
    assert "look at the rates and the step, since sums of the moments are right" in (
        report.first_wrong.replace(" and density control", "")
    )


def test_one_right_part_is_said_in_the_singular():
    said = first_wrong_iteration({"gradient_sum": 2}, ["loss", "gradient_sum"], {}).text
    assert said.endswith("since loss is right")


def test_an_operation_without_a_verdict_counts_as_right_and_one_with_a_failed_one_does_not():
    right = [Graded("covariance", "covariance", 1, True)]
    assert {claim.profile for claim in profile_claims(right)} == {"renderer-forward", "renderer", "method"}
    assert profile_claims([*right, Graded("harmonics", "", 1, False)]) == []
