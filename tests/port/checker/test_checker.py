"""The checker is itself checked: wrong gradients are refused, right ones accepted, blind checks refused."""

import json

import numpy as np
import pytest

from endotsr.port.gradcheck import (
    SINGLE,
    Pair,
    Settings,
    check_function,
    check_pair,
    check_precision,
    summary,
    table,
    to_json,
)
from endotsr.port.gradcheck.checker import judge
from endotsr.port.gradcheck.differences import Difference

FREQUENCIES = 4
COUNTS = (10, 30_000)


class Penalty:
    """Mean over Gaussians of a weighted smooth absolute value: tiny gradients, weights over five decades."""

    def __init__(self, count: int, power: int = 1):
        self.weights = np.geomspace(3e-5, 7.2, FREQUENCIES)[:, None]
        self.scale = 1.0 / count**power
        rng = np.random.default_rng(count)
        self.inputs = {"coefficients": rng.standard_normal((FREQUENCIES, count)) + 0.1}

    def forward(self, inputs):
        c = inputs["coefficients"]
        return {"loss": self.scale * np.sum(self.weights * np.sqrt(c * c + 0.01))}

    def reverse(self, inputs, cotangents):
        c = inputs["coefficients"]
        return {"coefficients": cotangents["loss"] * self.scale * self.weights * c / np.sqrt(c * c + 0.01)}


class Mixing:
    """Linear mixing of channels and a square: every output depends on several inputs of its column."""

    def __init__(self, count: int):
        rng = np.random.default_rng(count + 1)
        self.inputs = {"matrix": rng.standard_normal((3, 3)), "points": rng.standard_normal((3, count))}

    def forward(self, inputs):
        y = inputs["matrix"] @ inputs["points"]
        return {"out": y + 0.1 * y**2}

    def reverse(self, inputs, cotangents):
        y = inputs["matrix"] @ inputs["points"]
        d = cotangents["out"] * (1 + 0.2 * y)
        return {"matrix": d @ inputs["points"].T, "points": inputs["matrix"].T @ d}


def with_mistake(operation, name, change):
    """The operation's reverse pass with `change` applied to one gradient."""

    def reverse(inputs, cotangents):
        gradients = operation.reverse(inputs, cotangents)
        gradients[name] = change(gradients[name].copy(), inputs)
        return gradients

    return reverse


def zero_at(index):
    def change(gradient, _):
        gradient[index] = 0
        return gradient

    return change


def scale_at(index, factor):
    def change(gradient, _):
        gradient[index] *= factor
        return gradient

    return change


MISTAKES = {
    "0.1 percent": scale_at(..., 1.001),
    "0.02 percent": scale_at(..., 1.0002),
    "sign": scale_at(..., -1),
    "double": scale_at(..., 2),
    "zero": zero_at(...),
    "first Gaussian missing": zero_at((slice(None), 0)),
    "last Gaussian missing": zero_at((slice(None), -1)),
    "heaviest frequency doubled": scale_at(-1, 2),
    "lightest frequency doubled": scale_at(0, 2),
    "lightest frequency by 0.1 percent": scale_at(0, 1.001),
    "frequencies in reverse order": lambda gradient, _: gradient[::-1].copy(),
    "Gaussians shifted by one": lambda gradient, _: np.roll(gradient, 1, axis=1),
    "one entry not a number": scale_at((1, 2), np.nan),
}


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_wrong_gradient_of_a_mean_loss_is_refused(mistake, count):
    operation = Penalty(count)
    report = check_function(
        operation.forward, with_mistake(operation, "coefficients", MISTAKES[mistake]), operation.inputs
    )
    assert not report.passed, table([report])


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("power", [1, 3])
def test_right_gradient_of_a_mean_loss_is_accepted(count, power):
    """power 3: gradient entries of 1e-13 and below; nothing is compared to an absolute number."""
    operation = Penalty(count, power)
    report = check_function(operation.forward, operation.reverse, operation.inputs)
    assert report.passed, table([report])
    assert sum(block.unresolved for block in report.blocks) == 0


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize(
    "name, change",
    [
        ("matrix", lambda g, _: g.T.copy()),
        ("matrix", scale_at((0, 1), 1.001)),
        ("points", lambda g, i: np.linalg.inv(i["matrix"]) @ i["matrix"].T @ g),
        ("points", scale_at((2, slice(None)), -1)),
        ("points", zero_at((slice(None), 3))),
    ],
    ids=["transposed", "one entry", "R for R^T", "one row's sign", "one Gaussian missing"],
)
def test_wrong_gradient_of_a_matrix_operation_is_refused(name, change, count):
    operation = Mixing(count)
    assert check_function(operation.forward, operation.reverse, operation.inputs).passed
    report = check_function(operation.forward, with_mistake(operation, name, change), operation.inputs)
    assert not report.passed
    assert all(name in failure or "(all)" in failure for failure in report.failures), report.failures


def test_shape_and_presence_of_gradients():
    operation = Mixing(10)
    transposed = with_mistake(operation, "points", lambda g, _: g.T.copy())
    assert "shape (10, 3)" in check_function(operation.forward, transposed, operation.inputs).failures[0]
    missing = check_function(
        operation.forward, lambda i, u: {"matrix": operation.reverse(i, u)["matrix"]}, operation.inputs
    )
    assert missing.failures == ("no gradient for input points",)


def test_bare_arrays_and_numbers_are_accepted():
    report = check_function(
        lambda i: i["x"] ** 2, lambda i, u: {"x": 2 * i["x"] * u}, {"x": np.array([1.0, -2.0, 0.5])}
    )
    assert report.passed, report.failures
    report = check_function(
        lambda i: float(np.prod(i["x"])), lambda i, u: {"x": u * np.prod(i["x"]) / i["x"]}, {"x": np.array([1.0, -2.0])}
    )
    assert report.passed, report.failures


@pytest.mark.parametrize("factor, accepted", [(1.0, True), (1.05, False), (-1.0, False)])
def test_a_port_in_single_precision(factor, accepted):
    operation = Mixing(10)
    inputs = {name: value.astype(np.float32) for name, value in operation.inputs.items()}
    wrong = with_mistake(operation, "points", scale_at(..., np.float32(factor)))
    report = check_function(operation.forward, wrong, inputs, settings=SINGLE)
    assert report.passed == accepted, table([report])


def test_kinks_beside_the_inputs_are_stepped_around():
    """|x| with residuals down to 1e-4: coarse steps cross the kink, the plateau lies at fine steps."""
    x = np.concatenate([np.linspace(1e-4, 1, 40), -np.linspace(2.3e-4, 1, 40)])
    report = check_function(lambda i: np.mean(np.abs(i["x"])), lambda i, u: {"x": u * np.sign(i["x"]) / 80}, {"x": x})
    assert report.passed, table([report])


def jump(inputs):
    return {"out": np.where(inputs["x"] > 1, 2.0, 1.0) * inputs["x"]}


def jump_reverse(inputs, cotangents):
    return {"x": np.where(inputs["x"] > 1, 2.0, 1.0) * cotangents["out"]}


def jump_trace(inputs):
    return {"branch": (inputs["x"] > 1).astype(int)}


def test_steps_across_a_jump_are_avoided():
    x = {"x": np.array([0.5, 1 - 1e-4, 1 + 1e-4, 1.7])}
    report = check_function(jump, jump_reverse, x, trace=jump_trace)
    assert report.passed, table([report])


def test_probes_that_cannot_avoid_a_jump_are_refused_and_capped():
    x = {"x": np.array([0.5, 1 - 1e-9, 1.3, 1.7])}
    report = check_function(jump, jump_reverse, x, trace=jump_trace)
    assert any("refused" in failure for failure in report.failures)
    assert sum(block.refused for block in report.blocks) > 0


def test_zero_against_zero_is_confirmed_but_a_whole_zero_block_is_vacuous():
    def forward(i):
        return i["x"][0] ** 2 + 0 * i["y"].sum()

    def reverse(i, u):
        d = np.zeros((3, 3))
        d[0] = 2 * i["x"][0] * u
        return {"x": d, "y": np.zeros(2)}

    rng = np.random.default_rng(0)
    report = check_function(forward, reverse, {"x": rng.standard_normal((3, 3)), "y": rng.standard_normal(2)})
    assert report.failures == ("block y: the gradient is zero: nothing is tested",)
    assert report.blocks[1].zero > 0


def test_a_zero_gradient_against_a_tiny_difference_is_refused():
    report = check_function(lambda i: 1e-9 * np.sum(i["x"] ** 2), lambda i, u: {"x": 0 * u * i["x"]}, {"x": np.ones(5)})
    assert "probes failed" in report.failures[0]


def test_constant_and_non_finite_outputs_are_refused():
    x = {"x": np.ones(4)}
    black = check_function(lambda i: 0 * i["x"], lambda i, u: {"x": 0 * u}, x)
    assert black.failures == ("output output is constant: nothing is tested",)
    infinite = check_function(lambda i: i["x"] * np.inf, lambda i, u: {"x": u}, x)
    assert infinite.failures == ("output output is not finite",)


def test_a_derivative_below_rounding_is_unresolved_and_the_check_blind():
    """The output is 1e12 larger than what the input changes: no difference can see a relative error of 1e-4."""
    x = {"x": np.arange(1.0, 6.0)}
    report = check_function(lambda i: 1e12 + np.sum(i["x"] ** 2), lambda i, u: {"x": 2 * u * i["x"]}, x)
    assert any("blind" in failure for failure in report.failures), table([report])


def test_a_tolerance_that_accepts_the_negative_control_is_blind():
    operation = Mixing(10)
    report = check_function(operation.forward, operation.reverse, operation.inputs, settings=Settings(rtol=1e-3))
    assert any("blind" in failure for failure in report.failures)


def test_inputs_outside_all_blocks_are_named():
    operation = Mixing(10)
    report = check_function(
        operation.forward, operation.reverse, operation.inputs, blocks={"row 0": ("points", 0), "m": ("matrix", ...)}
    )
    assert report.failures == ("input points is not covered by the blocks",)


def test_reverse_that_is_not_linear_in_the_cotangents_is_refused():
    def reverse(inputs, u):
        return {"x": np.abs(u)}

    report = check_function(lambda i: i["x"].copy(), reverse, {"x": np.arange(1.0, 5.0)})
    assert not report.passed


def test_functions_that_modify_their_inputs_are_refused():
    def forward(inputs):
        inputs["x"] *= 1.5
        return inputs["x"] ** 2

    report = check_function(forward, lambda i, u: {"x": 2 * i["x"] * u}, {"x": np.arange(1.0, 5.0)})
    assert any("modified" in failure for failure in report.failures)


def test_judge_verdicts():
    exact = Difference(1.0, 1e-12, 1e-3)
    assert judge(1.0, exact) == "passed"
    assert judge(1.0 + 5e-8, exact) == "passed"
    assert judge(1.0 + 2e-7, exact) == "failed"
    assert judge(np.nan, exact) == "failed"
    assert judge(0.0, exact) == "failed"
    assert judge(1.0, Difference(1.0, 1e-3, 1e-3)) == "unresolved"
    assert judge(0.0, Difference(0.0, 0.0, 1e-3)) == "zero"
    assert judge(1.0, Difference(np.nan, np.nan, 1e-3, refused=True)) == "refused"


def penalty_pair(reverse=None, **options) -> Pair:
    operation = Penalty(10)
    return Pair(
        "penalty",
        "0",
        "tests.penalty",
        lambda rng: operation.inputs,
        operation.forward,
        reverse or operation.reverse,
        **options,
    )


def test_pair_with_blocks_hard_places_and_reports():
    pair = penalty_pair(
        blocks=lambda inputs: {f"frequency {k}": ("coefficients", k) for k in range(FREQUENCIES)},
        hard=lambda inputs: {"coefficients": np.array([7])},
    )
    report = check_pair(pair, np.random.default_rng(3))
    assert report.passed and [b.block for b in report.blocks[1:]] == [f"frequency {k}" for k in range(FREQUENCIES)]
    assert report.taylor == pytest.approx(2.0, abs=0.05)
    precision = check_precision(pair, np.random.default_rng(3))
    text = table([report], [precision])
    assert "\x1b" not in text and "frequency 3" in text
    assert "\x1b" in table([report], colour=True)
    assert "1 pairs" in summary([report]) and "all passed" in summary([report])
    data = json.loads(to_json([report], [precision], seed=3))
    assert data["pairs"][0]["blocks"][1]["block"] == "frequency 0" and data["seed"] == 3


def test_failed_pair_is_named_with_its_numbers():
    wrong = with_mistake(Penalty(10), "coefficients", MISTAKES["0.1 percent"])
    report = check_pair(penalty_pair(wrong), np.random.default_rng(0))
    assert "FAILED" in table([report]) and "1 failed: penalty" in summary([report])
    worst = report.blocks[1].worst
    assert worst is not None and worst.relative_error == pytest.approx(1e-3, rel=1e-2)
    assert report.taylor == pytest.approx(1.0, abs=0.05)
    assert not json.loads(to_json([report], [], seed=0))["passed"]


def test_single_precision_twin_is_compared():
    double = penalty_pair(single="needs double precision")
    assert check_precision(double, np.random.default_rng(0)).skipped == "needs double precision"

    def careless(inputs, cotangents):
        exact = Penalty(10).reverse(inputs, cotangents)["coefficients"]
        return {"coefficients": exact * (1.001 if inputs["coefficients"].dtype == np.float32 else 1.0)}

    good, bad = penalty_pair(), penalty_pair(careless)
    assert check_pair(bad, np.random.default_rng(0)).passed
    assert not check_precision(bad, np.random.default_rng(0)).passed
    report = check_precision(good, np.random.default_rng(0))
    assert [b for b in report.blocks if not b.passed] == []
