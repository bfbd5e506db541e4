"""Where a trajectory goes wrong first: the iteration, the part of it, and what happens there."""

import numpy as np
import pytest

from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.judge.trajectory import first_wrong_iteration
from endotsr.port.judge.verdict import judge

GOLDEN = read_golden(golden_folder())
CASES = {case.case: case for case in GOLDEN.cases if case.operation == "training"}
LONG = CASES["twenty_iterations"]
ALONG = [name for name, output in LONG.outputs.items() if output.order == "iteration"]


SAID = [
    ({"term_l1": 3, "loss": 3, "square_position": 3},
     "at iteration 3: term_l1, loss, square_position; look at the images and terms"),
    ({"loss": 12}, "look at the weights of the terms, since images and terms are right; the detail weight is full from "
                   "iteration 12; density control ends iteration 12"),
    ({"gradient_sum": 2, "square_position": 7},
     "iteration 2: gradient_sum; look at the statistics of density control, since images and terms, loss are right"),
    ({"second_moments": 9, "loss": 10}, "look at the gradients and the moments of Adam, since "),
    ({"second_moments": 6}, "look at the gradients and the moments of Adam and density control, since "),
    ({"square_position": 9},
     "look at the rates and the step, since images and terms, loss, sums of the statistics, sums of the moments are"),
    ({"count": 8}, "first wrong at iteration 8: count; the harmonic degree rises at iteration 7"),
    (dict.fromkeys(ALONG, 1), "first wrong at iteration 1: term_l1, term_ssim, term_depth and 19 more; look at the "),
]  # fmt: skip


@pytest.mark.parametrize("wrong, says", SAID)
def test_the_first_wrong_part_of_the_first_wrong_iteration_is_named(wrong, says):
    assert says in first_wrong_iteration(wrong, ALONG, LONG.settings).text


def test_nothing_is_said_where_nothing_is_wrong_or_nothing_happens():
    assert first_wrong_iteration({}, ALONG, LONG.settings) == ("", [])
    assert first_wrong_iteration({"loss": 4}, ["loss"], {}).text.endswith("look at the weights of the terms")
    assert first_wrong_iteration({"loss": 4}, ALONG, LONG.settings).events == []


def test_what_happens_in_every_refused_case_is_said(tmp_path):
    """Parameters that are wrong from the iteration after density control on, in three cases."""
    after = {"hidden": 3, "out_of_view": 5, "twenty_iterations": 7}
    for name, case in CASES.items():
        for output, asked in case.outputs.items():
            value = np.array(GOLDEN.array(case, asked.file))
            if output == "square_position" and name in after:
                value[after[name] - 1 :] *= 1.01
            write_npy(tmp_path / case.name / f"{output}.npy", value)
    lines = judge(GOLDEN._replace(cases=list(CASES.values())), tmp_path, "float64", level=4).diagnosis
    assert lines[0].startswith("first wrong: operation training, equation (6), level 4, square_position alone; ")
    assert [line.split(":")[0].strip() for line in lines[1:4]] == [CASES[name].name for name in CASES if name in after]
    assert lines[4] == "  in each of these cases density control ends this iteration or the one before"
    assert lines[5].startswith(f"  only in 3 of its {len(CASES)} cases: ")
