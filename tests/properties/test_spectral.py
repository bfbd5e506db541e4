"""Properties of the dictionary, the residuals, the Matern penalty, the deformation and the calibration."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from endotsr.method.equations.appearance import appearance_forward, appearance_reverse
from endotsr.method.equations.calibration import calibrate
from endotsr.method.equations.deformation import deformation_forward, deformation_reverse
from endotsr.method.equations.dictionary import atom_statistics, dictionary_forward, frequencies, normalised_atoms
from endotsr.method.equations.matern import matern_penalty_forward, matern_penalty_reverse, matern_weights
from endotsr.method.equations.motion import motion_forward, motion_reverse
from endotsr.method.kernels.constants import Y00
from properties.strategies import DTYPES, SEEDS

COUNTS = st.integers(1, 9)
POWERS = st.integers(-20, 20).map(lambda k: 2.0**k)
DYADIC = st.integers(-256, 512).map(lambda k: k / 256)
STAMPS = st.lists(st.floats(0, 1), min_size=1, max_size=12)
LENGTHS = st.one_of(st.floats(1e-3, 10.0), st.sampled_from([0.0, 1e-60, np.sqrt(5) / 16, 1e60, np.inf]))
SIZES = st.sampled_from([0.0, 1e-30, 1e-3, 1.0, 30.0, 1e30])


def coefficients(seed, count, n, dtype, size=1.0):
    return (size * np.random.default_rng(seed).normal(0, 1, (3, 2 * count, n))).astype(dtype)


# --- dictionary and statistics (1), (1b) ---


@given(COUNTS, st.floats(-3, 3), st.floats(-3, 3))
def test_a_shift_of_time_turns_every_pair(count, t, shift):
    """(sin, cos)(t + s) is (sin, cos)(t) turned by 2 pi w s; in particular the pair has length one."""
    omega = frequencies(count, 1.0, 16.0)
    sine, cosine = dictionary_forward(t, omega)[0].reshape(2, count)
    turn_sine, turn_cosine = dictionary_forward(shift, omega)[0].reshape(2, count)
    found = dictionary_forward(t + shift, omega)[0].reshape(2, count)
    expected = np.stack([sine * turn_cosine + cosine * turn_sine, cosine * turn_cosine - sine * turn_sine])
    assert np.abs(found - expected).max() <= 2e-13  # 2 pi w t u, w = 16, t = 6
    np.testing.assert_allclose(sine**2 + cosine**2, 1, rtol=1e-15)


@given(DYADIC, st.integers(1, 64), st.integers(-3, 3), DTYPES)
def test_whole_frequencies_are_periodic_bit_by_bit(t, omega, periods, dtype):
    omega = np.array([omega], dtype)
    assert np.array_equal(dictionary_forward(t, omega)[0], dictionary_forward(t + periods, omega)[0])


@given(st.lists(DYADIC, min_size=1, max_size=12), COUNTS, DYADIC)
@example([0.0, 0.5, 2.0**-40], 1, 1.0)
def test_statistics_under_a_shift_of_time(stamps, count, shift):
    """The mean of a pair turns with the shift; the sum of both variances does not change.

    Exact shifts: a rounded one may merge two stamps, 0 and 1e-81 for example, and equal stamps count once.
    """
    omega = frequencies(count, 1.0, 16.0)
    before, after = (atom_statistics(np.array(stamps) + s, omega) for s in (0.0, shift))
    energy = [(s.rms**2).reshape(2, count).sum(axis=0) for s in (before, after)]
    np.testing.assert_allclose(energy[0], energy[1], atol=2e-12)
    length = [np.hypot(*s.mean.reshape(2, count)) for s in (before, after)]
    np.testing.assert_allclose(length[0], length[1], atol=2e-12)


@given(STAMPS, st.data())
def test_hard_W2_statistics_do_not_depend_on_order_or_repeats(stamps, data):
    omega = frequencies(4, 1.0, 16.0)
    again = [*data.draw(st.permutations(stamps)), data.draw(st.sampled_from(stamps))]
    for one, two in zip(atom_statistics(stamps, omega), atom_statistics(again, omega)):
        assert np.array_equal(one, two)


@given(STAMPS, COUNTS)
@example([0.25, 0.75], 1)  # the cosine is the same at both: dead, the sine is not
def test_normalised_atoms_have_mean_zero_and_rms_one_or_are_zero(stamps, count):
    omega = frequencies(count, 1.0, 16.0)
    statistics = atom_statistics(stamps, omega)
    bars = np.stack([normalised_atoms(t, omega, statistics) for t in sorted(set(stamps))])
    rms = np.sqrt((bars**2).mean(axis=0))
    assert np.isfinite(bars).all() and (rms[statistics.dead] == 0).all()
    live = ~statistics.dead
    np.testing.assert_allclose(rms[live], 1, rtol=1e-9)
    assert np.abs(bars.mean(axis=0) * statistics.rms).max(initial=0) <= 1e-14


# --- residuals (2), (3) ---


@given(SEEDS, COUNTS, st.integers(0, 5), DTYPES, SIZES, st.floats(1e-3, 2.0))
def test_the_colour_residual_is_bounded_odd_and_finite(seed, count, n, dtype, size, beta):
    a, atoms = coefficients(seed, count, n, dtype, size), np.ones(2 * count, dtype)
    residual, saved = appearance_forward(a, atoms, beta)
    assert (np.abs(residual.astype(np.longdouble)) <= np.longdouble(dtype(beta / Y00))).all()
    assert np.array_equal(appearance_forward(-a, atoms, beta)[0], -residual)
    back = appearance_reverse(np.ones((3, n), dtype), saved)
    assert all(np.isfinite(g).all() for g in back)
    assert (back.d_appearance_coefficients >= 0).all()  # monotone in every coefficient of a positive atom


@given(SEEDS, COUNTS, DTYPES, st.permutations(range(3)))
def test_the_channels_of_both_residuals_do_not_mix(seed, count, dtype, order):
    order, c = list(order), coefficients(seed, count, 4, dtype)
    atoms = np.random.default_rng(seed).normal(0, 1, 2 * count).astype(dtype)
    for forward in (lambda x: appearance_forward(x, atoms, 0.3)[0], lambda x: motion_forward(x, atoms)[0]):
        assert np.array_equal(forward(np.ascontiguousarray(c[order])), forward(c)[order])


@given(SEEDS, COUNTS, POWERS)
def test_the_translation_residual_is_linear(seed, count, factor):
    one, two = coefficients(seed, count, 4, np.float64), coefficients(seed + 1, count, 4, np.float64)
    atoms = np.random.default_rng(seed).normal(0, 1, 2 * count)
    move = lambda c: motion_forward(c, atoms)[0]
    assert np.array_equal(move(factor * one), factor * move(one))
    size = np.abs(one).sum() + np.abs(two).sum()
    assert np.abs(move(one + two) - move(one) - move(two)).max() <= 1e-15 * size * np.abs(atoms).max()
    up = np.random.default_rng(seed).normal(0, 1, (3, 4))
    back = motion_reverse(up, motion_forward(one, atoms)[1])
    assert np.vdot(up, move(two)) == pytest.approx(np.vdot(back.d_motion_coefficients, two), rel=1e-11, abs=1e-11)


# --- Matern prior (4) ---


@given(SEEDS, COUNTS, st.integers(0, 6), LENGTHS)
def test_hard_M2_the_penalty_does_not_see_the_phase(seed, count, n, length):
    """Every (sin, cos) pair of coefficients turned by an angle of its own."""
    c, rho = coefficients(seed, count, n, np.float64), matern_weights(frequencies(count, 1.0, 16.0), length)
    angle = np.random.default_rng(seed + 1).uniform(0, 2 * np.pi, (3, count, n))
    sine, cosine = c[:, :count], c[:, count:]
    turned = np.concatenate(
        [np.cos(angle) * sine - np.sin(angle) * cosine, np.sin(angle) * sine + np.cos(angle) * cosine], axis=1
    )
    value, saved = matern_penalty_forward(c, rho)
    assert matern_penalty_forward(turned, rho)[0] == pytest.approx(value, rel=4e-15)
    assert np.vdot(matern_penalty_reverse(1.0, saved), c) == pytest.approx(2 * value, rel=1e-13)  # degree 2


@given(COUNTS, LENGTHS, POWERS, DTYPES)
def test_matern_weights_have_mean_one_rise_and_know_no_unit_of_time(count, length, factor, dtype):
    omega = frequencies(count, 1.0, 16.0, dtype)
    rho = matern_weights(omega, length)
    assert np.isfinite(rho).all() and (rho > 0).all() and (np.diff(rho) >= 0).all()
    assert abs(rho.astype(np.float64).mean() - 1) <= 4 * np.finfo(dtype).eps
    assert np.array_equal(matern_weights(omega * dtype(factor), length / factor), rho)


# --- deformation (B1) ---


@given(SEEDS, st.integers(0, 4), st.integers(0, 3), DTYPES, st.sampled_from(["quartic", "gaussian"]), DYADIC)
def test_the_deformation_is_even_in_the_width_linear_in_the_weight_and_moves_with_time(
    seed, bases, n, dtype, basis, shift
):
    rng = np.random.default_rng(seed)
    weight = rng.normal(0, 1, (10, bases, n)).astype(dtype)
    centre = (rng.integers(0, 257, weight.shape) / 256).astype(dtype)  # dyadic: the shift is exact
    width = rng.uniform(-0.3, 0.3, weight.shape).astype(dtype)
    at = lambda w, c, s, t: deformation_forward(w, c, s, t, basis)[0]
    offsets = at(weight, centre, width, 0.375)
    assert np.array_equal(at(weight, centre, -width, 0.375), offsets)
    assert np.array_equal(at(4 * weight, centre, width, 0.375), 4 * offsets)
    assert np.array_equal(at(weight, centre + dtype(shift), width, 0.375 + shift), offsets)
    _, saved = deformation_forward(weight, centre, width, 0.375, basis)
    back = deformation_reverse(np.ones((10, n), dtype), saved)
    assert np.allclose(np.sum(back.d_fdm_centre, dtype=np.float64), -float(back.d_t), rtol=1e-4, atol=1e-3)


# --- calibration (7) ---

RATIOS = st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3)), min_size=1, max_size=9)


def weight_of(pairs, ratio=0.25):
    return calibrate([(str(i), rgb, lap) for i, (rgb, lap) in enumerate(pairs)], ratio).lambda_lap


@given(RATIOS, POWERS, st.data())
def test_the_scale_rule_of_the_calibration(pairs, factor, data):
    """lambda follows g_rgb and r, opposes g_lap; order of the views and views without gradient do not matter."""
    weight = weight_of(pairs)
    assert weight_of([(factor * rgb, lap) for rgb, lap in pairs]) == pytest.approx(factor * weight, rel=1e-15)
    assert weight_of([(rgb, factor * lap) for rgb, lap in pairs]) == pytest.approx(weight / factor, rel=1e-15)
    assert weight_of(pairs, 0.25 * factor) == pytest.approx(factor * weight, rel=1e-15)
    assert weight_of(data.draw(st.permutations(pairs))) == weight
    assert weight_of([*pairs, (0.0, 1.0), (np.nan, 1.0), (1.0, np.inf)]) == weight
    ratios = [lap / rgb for rgb, lap in pairs]
    assert 0.25 / max(ratios) <= weight * (1 + 1e-15) and weight <= 0.25 / min(ratios) * (1 + 1e-15)
