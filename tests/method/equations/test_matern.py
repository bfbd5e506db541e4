"""Equation (4): the Matern weights and the motion penalty, hard cases M1 and M2."""

import numpy as np
import pytest

from endotsr.definition import matern as definition
from endotsr.method.equations.dictionary import frequencies
from endotsr.method.equations.matern import matern_penalty_forward, matern_penalty_reverse, matern_weights
from method.by_threads import assert_threads_change_no_bit
from oracle import matern_oracle

OMEGA = frequencies(8, 1.0, 16.0)
U = np.finfo(np.float64).eps / 2
DTYPES = [np.float32, np.float64]


def coefficients(n=11, dtype=np.float64, count=8):
    return np.random.default_rng(3).normal(size=(3, 2 * count, n)).astype(dtype)


@pytest.mark.parametrize("length", [1e-8, 1e-3, 0.02, 0.0222, 0.0223, 0.2, 1.0, 1e3, 1e60])
def test_hard_M1_against_extended_precision(length):
    found = matern_weights(OMEGA, length)
    for a, b in zip(found, matern_oracle.weights(OMEGA, length)):
        assert abs(a / float(b) - 1) <= 32 * U
    assert abs(found.mean() - 1) <= 4 * U
    if length > 1e-6:
        assert np.all(np.diff(found) > 0)


def test_hard_M1_is_the_reciprocal_student_density():
    np.testing.assert_allclose(matern_weights(OMEGA, 0.2), matern_oracle.weights_by_student(OMEGA, 0.2), rtol=2e-13)


@pytest.mark.parametrize("dtype", DTYPES)
def test_hard_M1_extreme_lengths_are_finite(dtype):
    omega = OMEGA.astype(dtype)
    for length in (1e-60, 1e-8, 1e3, 1e200, 1e308):
        assert np.all(np.isfinite(matern_weights(omega, length)))
    assert np.array_equal(matern_weights(omega, 0.0), np.ones(8, dtype))
    assert np.array_equal(matern_weights(omega, 1e-60), np.ones(8, dtype))
    assert np.array_equal(matern_weights(omega, 1e-10), np.ones(8, dtype))  # the specification states this length
    limit = matern_weights(omega, np.inf)
    assert limit.dtype == dtype
    assert limit[0] == pytest.approx(4.3255108e-07, rel=3e-7) and limit[-1] == pytest.approx(7.2570029, rel=3e-7)
    for length in (0.0, 0.2, np.inf):
        assert matern_weights(np.array([3.3], dtype), length).tolist() == [1.0]


def test_hard_M1_refused_input():
    for length in (-0.1, np.nan):
        with pytest.raises(ValueError, match="length"):
            matern_weights(OMEGA, length)
    for omega in (np.zeros(0), np.array([0.0, 1.0]), np.array([-1.0]), np.array([np.inf])):
        with pytest.raises(ValueError, match="frequencies"):
            matern_weights(omega, 0.2)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", [1, 11, 64, 131])
def test_penalty_equals_its_definition(n, dtype):
    c, rho = coefficients(n, dtype), matern_weights(OMEGA, 0.2).astype(dtype)
    wide = c.astype(np.float64), rho.astype(np.float64)
    value, saved = matern_penalty_forward(c, rho)
    expected, wide_saved = definition.matern_penalty_forward(*wide)
    assert value == pytest.approx(expected, rel=1e-14)
    gradient = matern_penalty_reverse(1.7, saved)
    assert gradient.dtype == dtype
    wanted = definition.matern_penalty_reverse(1.7, wide_saved)
    np.testing.assert_allclose(gradient, wanted, rtol=4 * np.finfo(dtype).eps)


def test_hard_M2_quadratic_and_empty():
    c, rho = coefficients(), matern_weights(OMEGA, 0.2)
    value, saved = matern_penalty_forward(c, rho)
    assert matern_penalty_forward(8.0 * c, rho)[0] == 64.0 * value
    assert np.vdot(matern_penalty_reverse(1.0, saved), c) == pytest.approx(2 * value, rel=1e-14)
    value, saved = matern_penalty_forward(c[..., :0], rho)
    assert value == 0.0 and matern_penalty_reverse(1.0, saved).shape == (3, 16, 0)
    value, saved = matern_penalty_forward(np.zeros_like(c), rho)
    assert value == 0.0 and not matern_penalty_reverse(1.0, saved).any()
    with pytest.raises(ValueError, match="expected"):
        matern_penalty_forward(c, rho[:-1])


@pytest.mark.parametrize("dtype", DTYPES)
def test_threads_agree(dtype):
    c, rho = coefficients(700, dtype), matern_weights(OMEGA, 0.2).astype(dtype)

    def compute():
        value, saved = matern_penalty_forward(c, rho)
        return value, matern_penalty_reverse(1.0, saved)

    assert_threads_change_no_bit(compute)
