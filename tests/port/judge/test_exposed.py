"""The exposure within the whole method: real ports with one mistake of it are refused at its level and named.

The port is the definition in NumPy with one function replaced. The operation alone (family `exposure`) stays right, so
a refusal comes from the cases of `objective` and `training` that carry an exposure.
"""

import inspect

import numpy as np
import pytest
from made_up_ports import case_of

from endotsr.definition import train, view
from endotsr.definition.exposure import ExposureGrads, exposure_forward, exposure_reverse
from endotsr.port.judge.case_verdict import judge_case
from endotsr.port.judge.npy import write_npy
from endotsr.port.judge.profiles import of_profile
from endotsr.port.judge.verdict import conclude, judge
from endotsr.port.operations.definition import definition_operations
from endotsr.port.reference import stored

CASES = {"objective": "objective/exposed", "training": "training/exposed"}


def answered(golden, folder, operation):
    """The definition's answer to the exposed case of an operation, as it is now."""
    case = case_of(golden, CASES[operation])
    found = definition_operations()[operation].compute(golden.inputs(case), dict(case.settings))
    for name in case.outputs:
        write_npy(folder / case.name / f"{name}.npy", stored(found[name]))
    return case


def report_on(golden, folder, operation):
    case = answered(golden, folder, operation)
    return conclude(golden, [judge_case(golden, case, folder, "float64")], "float64", 5, [])


def gradient_without_gain(d_exposed, saved):
    return exposure_reverse(d_exposed, saved)._replace(d_colour=d_exposed)


def bias_gradient_dropped(d_exposed, saved):
    grads = exposure_reverse(d_exposed, saved)
    return grads._replace(d_bias=0 * grads.d_bias)


def exposure_gradient_over_tissue(d_exposed, saved):
    """The tissue of the case: its mask is False in the last 4 rows of the last 5 columns."""
    inside = np.ones(d_exposed.shape[1:], bool)
    inside[-4:, -5:] = False
    sums = exposure_reverse(np.where(inside, d_exposed, 0), saved)
    return ExposureGrads(exposure_reverse(d_exposed, saved).d_colour, sums.d_log_gain, sums.d_bias)


REVERSE = (gradient_without_gain, bias_gradient_dropped, exposure_gradient_over_tissue)


@pytest.mark.parametrize("operation", CASES)
def test_the_right_definition_passes(golden, tmp_path, operation):
    report = report_on(golden, tmp_path, operation)
    assert report.accepted and not report.suspects


@pytest.mark.parametrize("wrong", REVERSE, ids=lambda wrong: wrong.__name__)
def test_a_wrong_reverse_pass_in_the_objective_is_refused_and_named(golden, tmp_path, monkeypatch, wrong):
    monkeypatch.setattr(view, "exposure_reverse", wrong)
    report = report_on(golden, tmp_path, "objective")
    refused = [o for case in report.cases for o in case.outputs if o.status == "refused"]
    assert refused and {o.level for o in refused} == {3} and all(o.name.startswith("d_") for o in refused)
    assert [one.flag for one in report.suspects if one.named][:1] == [wrong.__name__]


def clamped_before(colour, log_gain, bias):
    exposed, saved = exposure_forward(np.clip(colour, 0, 1), log_gain, bias)
    return exposed, (saved, (colour >= 0) & (colour <= 1))


def clamped_before_reverse(d_exposed, saved):
    grads = exposure_reverse(d_exposed, saved[0])
    return grads._replace(d_colour=np.where(saved[1], grads.d_colour, 0))


def clamped_after(colour, log_gain, bias):
    exposed, saved = exposure_forward(colour, log_gain, bias)
    return np.clip(exposed, 0, 1), (saved, (exposed >= 0) & (exposed <= 1))


def clamped_after_reverse(d_exposed, saved):
    return exposure_reverse(np.where(saved[1], d_exposed, 0), saved[0])


@pytest.mark.parametrize(
    ("forward", "reverse", "flag"),
    [
        (clamped_before, clamped_before_reverse, "render_clamped_before_exposure"),
        (clamped_after, clamped_after_reverse, "exposure_clamped"),
    ],
    ids=["before", "after"],
)
def test_a_clamp_before_or_after_the_exposure_is_refused_and_named(
    golden, tmp_path, monkeypatch, forward, reverse, flag
):
    monkeypatch.setattr(view, "exposure_forward", forward)
    monkeypatch.setattr(view, "exposure_reverse", reverse)
    report = report_on(golden, tmp_path, "objective")
    assert [one.flag for one in report.suspects if one.named][:1] == [flag]


def test_the_exposure_of_another_frame_is_refused_at_level_4_and_named(golden, tmp_path, monkeypatch):
    """No case of `objective` has more than one exposure."""
    changed = inspect.getsource(train.iterate)
    for old, new in (
        ("    frame = frame_of", "    wrong = min(sequence.train_index[k], 9)\n    frame = frame_of"),
        ("array[:, k]", "array[:, wrong]"),
        ("stepped(state, view, k,", "stepped(state, view, wrong,"),
    ):
        assert changed.count(old) == 1
        changed = changed.replace(old, new)
    exec(changed, space := dict(vars(train)))
    monkeypatch.setattr(train, "iterate", space["iterate"])
    report = report_on(golden, tmp_path, "training")
    assert {o.level for one in report.cases for o in one.outputs if o.status == "refused"} == {4}
    assert [one.flag for one in report.suspects if one.named][:1] == ["exposure_by_number_of_frame"]


def test_a_port_without_the_exposure_is_not_asked_for_the_cases_that_use_it(golden, tmp_path):
    """Its claim names the exposure alone, also where it has the objective."""
    (tmp_path / "not_ported.txt").write_text("exposure\n")
    report = judge(golden, tmp_path, "float64", again=tmp_path)
    left = {case.name for case in report.cases if case.status == "not ported"}
    assert left == {case.name for case in golden.cases if case.operation == "exposure"} | set(CASES.values())
    compared = {o.name for case in report.cases if case.name == "determinism/again" for o in case.outputs}
    assert compared and not any(name.startswith(tuple(CASES.values())) for name in compared)


def test_no_profile_has_a_case_that_uses_the_exposure(golden):
    using = {case.name for case in golden.cases if case.options}
    assert using == set(CASES.values())
    for profile in ("method", "training"):
        names = {case.name for case in of_profile(golden.cases, profile)}
        assert not names & using and "objective/paper" in names
