"""Derivatives along a line: known functions, error bars that hold, refusals."""

import numpy as np
import pytest

from endotsr.port.gradcheck.differences import (
    plateau_difference,
    taylor_slope,
)

X = np.linspace(0.2, 1.7, 7)
V = np.array([0.3, -1.1, 0.4, 2.0, -0.6, 0.9, -1.3])


def line(h):
    return np.exp(np.sin(X + h * V))


DERIVATIVE = float(np.sum(np.exp(np.sin(X)) * np.cos(X) * V))


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_plateau_at_any_magnitude(scale):
    found = plateau_difference(lambda h: scale * line(h))
    assert found.value == pytest.approx(scale * DERIVATIVE, rel=1e-9)
    assert found.error < 1e-8 * abs(found.value)


@pytest.mark.parametrize("offset", [1e3, 1e6, 1e8, 1e10])
def test_error_bar_covers_the_error_when_the_derivative_drowns(offset):
    found = plateau_difference(lambda h: offset + line(h))
    assert abs(found.value - DERIVATIVE) <= found.error


def test_plateau_of_noise_has_a_wide_error_bar():
    rng = np.random.default_rng(0)
    found = plateau_difference(lambda h: 1e-6 * rng.standard_normal(3))
    assert found.error >= abs(found.value)


def test_plateau_beside_a_kink_uses_finer_steps():
    found = plateau_difference(lambda h: np.abs(np.array([1e-5 + h, 2.0 + 0.5 * h])))
    assert found.value == pytest.approx(1.5, rel=1e-9)
    assert found.step < 1e-5


def test_refused_steps_and_refused_lines():
    found = plateau_difference(lambda h: None if abs(h) > 1e-4 else line(h))
    assert found.value == pytest.approx(DERIVATIVE, rel=1e-8) and found.step < 1e-4
    one_sided = plateau_difference(lambda h: None if h < 0 else line(h))
    assert one_sided.refused


@pytest.mark.parametrize("error", [0.0, 1e-4, 1e-3, 1.0])
def test_taylor_slope_tells_a_right_derivative_from_a_wrong_one(error):
    found = taylor_slope(line, DERIVATIVE * (1 + error))
    assert found.passed == (error == 0)
    assert found.slope == pytest.approx(1.0 if error else 2.0, abs=0.1)


def test_taylor_of_a_linear_function():
    found = taylor_slope(lambda h: X + h * V, float(V.sum()))
    assert found.linear and found.passed


def test_taylor_needs_an_origin():
    with pytest.raises(ValueError, match="at 0"):
        taylor_slope(lambda h: None, 1.0)
