"""Equations (2) and (3): the colour and the translation residual, hard cases H3 and T1 to T4."""

import mpmath
import numpy as np
import pytest

from endotsr.definition import appearance as definition
from endotsr.definition import motion as motion_definition
from endotsr.method.equations import appearance, atom_sums
from endotsr.method.equations.appearance import appearance_forward, appearance_reverse
from endotsr.method.equations.motion import motion_forward, motion_reverse
from endotsr.method.kernels.constants import Y00
from method.by_threads import assert_threads_change_no_bit

BETA = 0.3
DTYPES = [np.float32, np.float64]


def unit(dtype):
    return np.finfo(dtype).eps / 2


def case(n, dtype=np.float64, seed=0, scale=0.3):
    rng = np.random.default_rng(seed)
    coefficients = (scale * rng.normal(size=(3, 16, n))).astype(dtype)
    return coefficients, rng.normal(size=16).astype(dtype), rng.normal(size=(3, n)).astype(dtype)


def one_argument(x, dtype):
    """The residual and its slope at the arguments x, through one atom of value 1."""
    x = np.asarray(x, dtype)
    residual, saved = appearance_forward(np.tile(x, (3, 1, 1)), np.ones(1, dtype), Y00)  # beta / Y00 = 1
    return residual[0], saved.slope[0]


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", [0, 1, 7, 70, 1100])
def test_residuals_equal_their_definition(n, dtype):
    coefficients, atoms, upstream = case(n, dtype)
    wide = [a.astype(np.float64) for a in (coefficients, atoms, upstream)]
    bound = 64 * unit(dtype)  # 16 products and sums of size <= 4, then the squashing
    residual, saved = appearance_forward(coefficients, atoms, BETA)
    assert residual.dtype == dtype
    expected_residual, wide_saved = definition.appearance_forward(*wide[:2], BETA)
    np.testing.assert_allclose(residual, expected_residual, rtol=0, atol=bound)
    grads = appearance_reverse(upstream, saved)
    for found, expected in zip(grads, definition.appearance_reverse(wide[2], wide_saved)):
        assert found.dtype == dtype
        np.testing.assert_allclose(found, expected, rtol=bound, atol=bound * (1 + np.abs(expected).max(initial=0)))
    translation, saved = motion_forward(coefficients, atoms)
    expected_translation, wide_saved = motion_definition.motion_forward(*wide[:2])
    np.testing.assert_allclose(translation, expected_translation, rtol=0, atol=bound)
    wanted = motion_definition.motion_reverse(wide[2], wide_saved)
    for found, expected in zip(motion_reverse(upstream, saved), wanted):
        np.testing.assert_allclose(found, expected, rtol=bound, atol=bound * (1 + np.abs(expected).max(initial=0)))


@pytest.mark.parametrize("dtype", DTYPES)
def test_each_product_and_each_sum_of_the_atoms_is_rounded(dtype):
    coefficients, atoms, _ = case(1100, dtype)
    expected = np.zeros((3, 1100), dtype)
    for k, atom in enumerate(atoms):
        expected = expected + atom * coefficients[:, k]
    assert expected.dtype == dtype
    np.testing.assert_array_equal(atom_sums.combine(coefficients, atoms), expected)


@pytest.mark.parametrize("dtype", DTYPES)
def test_hard_H3_a_tiny_residual_keeps_its_digits(dtype):
    """beta tanh(x) / Y00 relative to 8 u down to x = 1e-30; colour with it minus colour without it is 0 in float32."""
    x = np.geomspace(1e-30, 1e-9, 64).astype(dtype)
    residual, saved = appearance_forward(np.tile(x, (3, 1, 1)), np.ones(1, dtype), BETA)
    np.testing.assert_allclose(residual[0], BETA / Y00 * x.astype(np.float64), rtol=8 * unit(dtype))
    back = appearance_reverse(np.ones((3, 64), dtype), saved)
    np.testing.assert_allclose(back.d_appearance_coefficients, BETA / Y00, rtol=8 * unit(dtype))
    np.testing.assert_allclose(back.d_phi_bar, 3 * BETA / Y00 * x.astype(np.float64).sum(), rtol=8 * unit(dtype))
    if dtype is np.float32:
        base = np.float32(0.5)
        assert ((base + residual[0]) - base == 0).all()


@pytest.mark.parametrize(("dtype", "top"), [(np.float64, 350.0), (np.float32, 43.0)])
def test_hard_T1_slope_keeps_its_digits_when_saturated(dtype, top):
    x = np.concatenate([np.geomspace(1e-6, top, 400), np.linspace(0.4, 0.6, 41), [8, 10, 15, 19.1]]).astype(dtype)
    value, slope = one_argument(x, dtype)
    with mpmath.workdps(400):
        for k, v in enumerate(x):
            e = mpmath.exp(-2 * mpmath.mpf(float(v)))
            assert abs(slope[k] / float(4 * e / (1 + e) ** 2) - 1) <= 8 * unit(dtype)
            assert abs(value[k] / float((1 - e) / (1 + e)) - 1) <= 8 * unit(dtype)


@pytest.mark.parametrize("dtype", DTYPES)
def test_hard_T2_zero_coefficients_change_nothing_but_can_start(dtype):
    _, atoms, upstream = case(9, dtype)
    residual, saved = appearance_forward(np.zeros((3, 16, 9), dtype), atoms, BETA)
    assert np.array_equal(residual, np.zeros((3, 9), dtype))
    base = np.random.default_rng(1).normal(size=(3, 9)).astype(dtype)
    assert (base + residual).tobytes() == base.tobytes()
    gradient = appearance_reverse(upstream, saved).d_appearance_coefficients
    expected = BETA / Y00 * np.einsum("ci,a->cai", upstream.astype(np.float64), atoms.astype(np.float64))
    np.testing.assert_allclose(gradient, expected, rtol=4 * unit(dtype))
    translation, _ = motion_forward(np.zeros((3, 16, 9), dtype), atoms)
    assert np.array_equal(translation, np.zeros((3, 9), dtype))


def test_the_gradient_by_the_atoms_is_made_only_when_asked_for():
    coefficients, atoms, upstream = case(9, np.float64)
    for forward, reverse in (
        (lambda c, a: appearance_forward(c, a, BETA), appearance_reverse),
        (motion_forward, motion_reverse),
    ):
        _, saved = forward(coefficients, atoms)
        whole, part = reverse(upstream, saved), reverse(upstream, saved, atom_gradient=False)
        assert part[1] is None and whole[1] is not None
        assert np.array_equal(part[0], whole[0])


@pytest.mark.parametrize("dtype", DTYPES)
def test_hard_T3_bounded_odd_monotone(dtype):
    x = np.concatenate([np.linspace(0, 1, 2001), np.linspace(1, 30, 500), [1e3, 1e6]]).astype(dtype)
    value, _ = one_argument(x, dtype)
    mirrored, _ = one_argument(-x, dtype)
    assert np.array_equal(mirrored, -value)
    assert np.all(np.diff(value) >= 0)
    coefficients, atoms, _ = case(50, dtype, scale=10.0)
    residual, _ = appearance_forward(coefficients, atoms, BETA)
    assert np.all(np.abs(residual) <= dtype(BETA / Y00))
    assert np.abs(residual).max() > 0.99 * BETA / Y00


@pytest.mark.parametrize(("dtype", "huge"), [(np.float64, 1e300), (np.float32, 1e37)])
def test_hard_T4_huge_coefficients_stay_finite(dtype, huge):
    coefficients = np.full((3, 4, 5), huge, dtype)
    coefficients[1] *= -1
    residual, saved = appearance_forward(coefficients, np.array([1, 0.5, -0.25, 0.1], dtype), BETA)
    grads = appearance_reverse(np.ones((3, 5), dtype), saved)
    assert np.all(np.isfinite(residual)) and all(np.all(np.isfinite(g)) for g in grads)
    assert np.array_equal(np.sign(residual[:, 0]), [1, -1, 1])


def test_nan_is_not_hidden():
    value, slope = one_argument([np.nan, 1.0], np.float64)
    assert np.isnan(value[0]) and np.isnan(slope[0]) and np.isfinite(value[1])


@pytest.mark.parametrize("dtype", DTYPES)
def test_threads_and_interpreter_agree(dtype):
    coefficients, atoms, upstream = case(2500, dtype)

    def compute():
        residual, saved = appearance_forward(coefficients, atoms, BETA)
        return residual, *appearance_reverse(upstream, saved)

    assert_threads_change_no_bit(compute)


def test_kernels_equal_their_python_bodies(monkeypatch):
    coefficients, atoms, upstream = case(70)
    residual, saved = appearance_forward(coefficients, atoms, BETA)
    grads = appearance_reverse(upstream, saved)
    monkeypatch.setattr(appearance, "_squash_kernel", appearance._squash_kernel.py_func)
    for name in ("_combine_kernel", "_spread_kernel"):
        monkeypatch.setattr(atom_sums, name, getattr(atom_sums, name).py_func)
    again, saved = appearance_forward(coefficients, atoms, BETA)
    np.testing.assert_allclose(again, residual, rtol=4e-16)
    for a, b in zip(grads, appearance_reverse(upstream, saved)):
        np.testing.assert_allclose(a, b, rtol=4e-16, atol=1e-14)


def test_refused_input():
    coefficients, atoms, upstream = case(5)
    for beta in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="beta"):
            appearance_forward(coefficients, atoms, beta)
    with pytest.raises(ValueError, match="expected"):
        motion_forward(coefficients, atoms[:-1])
    with pytest.raises(ValueError, match="d_out"):
        motion_reverse(upstream[:, :-1], motion_forward(coefficients, atoms)[1])


@pytest.mark.parametrize("beta", [0.01, 0.3, 3.0, 100.0])
def test_the_slope_of_a_saturated_residual_is_bounded_in_proportion_to_beta(beta):
    for dtype, bound in ((np.float32, 2e-37), (np.float64, 1e-306)):
        coefficients = np.full((3, 2, 1), 1e4, dtype)
        _, saved = appearance_forward(coefficients, np.ones(2, dtype), beta)
        slope = appearance_reverse(np.ones((3, 1), dtype), saved).d_appearance_coefficients.max()
        assert 0 <= slope <= bound * beta


def test_between_two_times_a_colour_changes_by_up_to_twice_beta():
    coefficients = np.full((3, 2, 1), 40.0)
    one, other = (Y00 * appearance_forward(coefficients, np.full(2, at), BETA)[0] for at in (1.0, -1.0))
    assert np.abs(one).max() == pytest.approx(BETA, rel=1e-15)
    assert np.abs(one - other).max() == pytest.approx(2 * BETA, rel=1e-15)
