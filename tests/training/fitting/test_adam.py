"""Adam, equation (B10), against its oracle; hard cases O1-O4; the fused deformation step."""

import mpmath
import numba
import numpy as np
import pytest

from endotsr.method.equations.deformation import BASES, deformation_forward, deformation_reverse
from endotsr.method.equations.deformation import GAUSSIANS_PER_PIECE as PIECE
from endotsr.training.fitting.adam import AdamState, adam_state, adam_step, adam_update, add_array
from endotsr.training.fitting.fused.deformation import NAMES, FdmArrays, deformation_adam_step
from oracle.adam import adam_scalar

BETAS = (0.9, 0.999, 1e-15)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.mark.parametrize(("dtype", "bound"), [("float64", 1e-14), ("float32", 3e-6)])
def test_many_steps_equal_the_oracle(rng, dtype, bound):
    parameter = rng.normal(size=(3, 5)).astype(dtype)
    gradients = rng.normal(size=(20, 3, 5)).astype(dtype)
    start = parameter.astype(np.float64)
    state = adam_state({"p": parameter})
    for gradient in gradients:
        adam_update(state, {"p": parameter}, {"p": gradient}, {"p": 0.01}, *BETAS)
    assert state.step == {"p": 20}
    for index in np.ndindex(parameter.shape):
        sequence = iter(gradients[(slice(None), *index)].astype(np.float64))
        truth = adam_scalar(start[index], lambda _, s=sequence: next(s), 20, 0.01, *BETAS)[-1]
        assert abs(parameter[index] - truth) <= bound


def test_hard_O1_tiny_epsilon_is_finite_and_amplifies_rounding_noise():
    """With epsilon 1e-15 a first gradient of 1e-14 moves 0.91 of the rate, 1e-16 moves 0.09, in float32 too."""
    for dtype in ("float32", "float64"):
        gradient = np.array([1e-14, 1e-16, 1e-30, 1e-45, 0.0, -0.0, 1e18], dtype)
        parameter, first, second = (np.zeros_like(gradient) for _ in range(3))
        adam_step(parameter, gradient, first, second, 1, 0.5, *BETAS)
        share = -parameter / 0.5
        assert share[0] == pytest.approx(1 / 1.1, rel=1e-5)
        assert share[1] == pytest.approx(1 / 11, rel=1e-5)
        assert np.isfinite(parameter).all()
        assert (share[2:4] >= 0).all() and (share[2:4] < 1e-14).all()
        assert (share[4:6] == 0).all()
        assert share[6] == pytest.approx(1.0, rel=1e-5)


def test_hard_O1_bits_do_not_depend_on_threads(rng):
    gradient = rng.normal(size=20_001).astype(np.float32)
    before, results = numba.get_num_threads(), []
    try:
        for threads in (1, before):
            numba.set_num_threads(threads)
            parameter = np.zeros_like(gradient)
            state = adam_state({"p": parameter})
            for _ in range(3):
                adam_update(state, {"p": parameter}, {"p": gradient}, {"p": 0.01}, *BETAS)
            results.append(parameter)
    finally:
        numba.set_num_threads(before)
    np.testing.assert_array_equal(*results)


def test_hard_O2_zero_gradient_still_moves_by_momentum():
    parameter = np.zeros(1)
    state = adam_state({"p": parameter})
    adam_update(state, {"p": parameter}, {"p": np.ones(1)}, {"p": 0.1}, *BETAS)
    after_one = parameter.copy()
    adam_update(state, {"p": parameter}, {"p": np.zeros(1)}, {"p": 0.1}, *BETAS)
    assert parameter[0] < after_one[0] - 0.05


def test_hard_O3_ten_steps_on_a_quadratic_against_mpmath():
    with mpmath.workdps(50):
        number = mpmath.mpf
        path = adam_scalar(
            number(1.5), lambda p: 2 * p, 10, number(0.1), number(0.9), number(0.999), number(1e-15), number(1) / 2
        )
        truth = np.array([float(p) for p in path])
    parameter = np.array([1.5])
    state, found = adam_state({"p": parameter}), []
    for _ in range(10):
        adam_update(state, {"p": parameter}, {"p": 2 * parameter}, {"p": 0.1}, *BETAS)
        found.append(parameter[0])
    np.testing.assert_allclose(found, truth, rtol=1e-13)


def test_hard_O4_no_gaussians_is_safe():
    parameter = np.zeros((3, 0), np.float32)
    state = adam_state({"p": parameter})
    adam_update(state, {"p": parameter}, {"p": parameter.copy()}, {"p": 0.1}, *BETAS)
    assert state.step == {"p": 1}


def test_hard_O4_arrays_born_late_start_fresh(rng):
    """The first move of a new array is one rate, whatever the age of the others."""
    old, new = np.zeros(4), np.zeros(4)
    state = adam_state({"old": old})
    for _ in range(50):
        adam_update(state, {"old": old}, {"old": np.ones(4)}, {"old": 0.1}, *BETAS)
    add_array(state, "new", new)
    both = {"old": old, "new": new}
    adam_update(state, both, {"old": np.ones(4), "new": 3 * np.ones(4)}, {"old": 0.1, "new": 0.1}, *BETAS)
    assert state.step == {"old": 51, "new": 1}
    np.testing.assert_allclose(new, -0.1, rtol=1e-12)


def test_a_row_born_in_an_old_array_moves_more_than_one_rate():
    """Zero moments under an old step counter: the first move is sqrt(10 (1 - 0.999^k)) rates, 2.1 at k = 600."""
    parameter, first, second = np.zeros(1), np.zeros(1), np.zeros(1)
    adam_step(parameter, np.ones(1), first, second, 600, 1.0, *BETAS)
    assert -parameter[0] == pytest.approx(0.1 * np.sqrt((1 - 0.999**600) / 0.001), rel=1e-12)
    assert -parameter[0] == pytest.approx(2.12, abs=0.01)


def test_subnormal_moments_are_flushed():
    """A first moment left alone decays to zero, not into subnormal numbers that never vanish."""
    parameter, gradient = np.zeros(1, np.float32), np.zeros(1, np.float32)
    first, second = np.full(1, 1e-37, np.float32), np.full(1, 1e-10, np.float32)
    for k in range(1, 60):
        adam_step(parameter, gradient, first, second, k, 0.1, *BETAS)
    assert first[0] == 0


def test_nan_gradient_is_not_swallowed():
    parameter, first, second = np.zeros(1), np.zeros(1), np.zeros(1)
    adam_step(parameter, np.array([np.nan]), first, second, 1, 0.1, *BETAS)
    assert np.isnan(parameter[0]) and np.isnan(first[0])


def test_parts_of_the_leading_axis_have_their_own_rate():
    parameter = np.zeros((4, 2))
    state = adam_state({"p": parameter})
    rates = {"p": ((slice(0, 1), 0.1), (slice(1, None), 0.2))}
    adam_update(state, {"p": parameter}, {"p": np.ones((4, 2))}, rates, *BETAS)
    np.testing.assert_allclose(parameter[:, 0], [-0.1, -0.2, -0.2, -0.2], rtol=1e-12)
    assert state.step == {"p": 1}


def test_arrays_without_gradient_are_left_alone():
    parameters = {"a": np.ones(2), "b": np.ones(2)}
    state = adam_state(parameters)
    adam_update(state, parameters, {"a": np.ones(2)}, {"a": 0.1, "b": 0.1}, *BETAS)
    assert state.step == {"a": 1, "b": 0}
    assert (parameters["b"] == 1).all()


def test_bad_arguments_are_refused():
    one = np.zeros((2, 3))
    with pytest.raises(ValueError, match="gradient"):
        adam_step(one, np.zeros((3, 2)), one.copy(), one.copy(), 1, 0.1, *BETAS)
    with pytest.raises(ValueError, match="second"):
        adam_step(one, one.copy(), one.copy(), one.astype(np.float32), 1, 0.1, *BETAS)
    with pytest.raises(ValueError, match=r"parameter: .* got strided"):
        adam_step(one[:, :2], one[:, :2].copy(), one[:, :2].copy(), one[:, :2].copy(), 1, 0.1, *BETAS)
    with pytest.raises(ValueError, match="step"):
        adam_step(one, one.copy(), one.copy(), one.copy(), 0, 0.1, *BETAS)


def _deformation(rng, dtype, bases, count):
    shape = (10, bases, count)
    values = (rng.normal(size=shape), rng.uniform(0, 1, shape), rng.uniform(0.02, 0.3, shape))
    return {name: v.astype(dtype) for name, v in zip(NAMES, values, strict=True)}


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize(
    ("bases", "count", "steps"),
    [(3, 7, 3), (1, PIECE + 6, 1), (2, 2 * PIECE, 1), (3, 1, 2)],
)
def test_fused_deformation_step_equals_reverse_then_adam_bitwise(rng, basis, dtype, bases, count, steps):
    separate = _deformation(rng, dtype, bases, count)
    fused = {name: a.copy() for name, a in separate.items()}
    states = [adam_state(separate), adam_state(fused)]
    rates = dict.fromkeys(NAMES, 1.6e-3) | {"fdm_weight": ((slice(0, 3), 4e-3), (slice(3, 10), 1.6e-3))}
    for k in range(steps):
        d_offsets = rng.normal(size=(10, count)).astype(dtype)
        _, saved = deformation_forward(*separate.values(), t=0.3 * k, basis=basis)
        grads = deformation_reverse(d_offsets, saved)
        adam_update(states[0], separate, dict(zip(NAMES, grads[:3], strict=True)), rates, *BETAS)
        _, saved = deformation_forward(*fused.values(), t=0.3 * k, basis=basis)
        ahead = (0.0, None, 0.81)[k]
        offsets = deformation_adam_step(d_offsets, FdmArrays(*fused.values()), saved, states[1], rates, *BETAS, ahead)
        if ahead is None:
            assert offsets is None
        else:
            np.testing.assert_array_equal(offsets, deformation_forward(*separate.values(), t=ahead, basis=basis)[0])
    assert states[0].step == states[1].step == dict.fromkeys(NAMES, steps)
    for name in NAMES:
        np.testing.assert_array_equal(separate[name], fused[name])
        np.testing.assert_array_equal(states[0].first[name], states[1].first[name])
        np.testing.assert_array_equal(states[0].second[name], states[1].second[name])


def test_fused_step_with_rates_and_counters_of_their_own(rng):
    """Every array, and every part of its channels, may have its own rate and its own number of steps."""
    separate = _deformation(rng, np.float64, 2, 6)
    fused = {name: a.copy() for name, a in separate.items()}
    states = [adam_state(separate), adam_state(fused)]
    parts = (slice(0, 3), slice(3, 7), slice(7, 10))
    rates = {n: tuple((p, 1e-3 * (1 + 3 * i + j)) for j, p in enumerate(parts)) for i, n in enumerate(NAMES)}
    for state in states:
        state.step.update(zip(NAMES, (0, 4, 11), strict=True))
    d_offsets = rng.normal(size=(10, 6))
    _, saved = deformation_forward(*separate.values(), t=0.4)
    grads = deformation_reverse(d_offsets, saved)
    adam_update(states[0], separate, dict(zip(NAMES, grads[:3], strict=True)), rates, *BETAS)
    _, saved = deformation_forward(*fused.values(), t=0.4)
    deformation_adam_step(d_offsets, FdmArrays(*fused.values()), saved, states[1], rates, *BETAS)
    assert states[0].step == states[1].step == dict(zip(NAMES, (1, 5, 12), strict=True))
    for name in NAMES:
        np.testing.assert_array_equal(separate[name], fused[name])


def test_fused_step_refuses_arrays_that_disagree(rng):
    parameters = _deformation(rng, np.float64, 3, 4)
    out, saved = deformation_forward(*parameters.values(), t=0.5)
    state = adam_state(parameters)
    rates = dict.fromkeys(NAMES, 1e-3)
    with pytest.raises(ValueError, match="d_offsets"):
        deformation_adam_step(out[:, :3].copy(), FdmArrays(*parameters.values()), saved, state, rates, *BETAS)
    short = np.zeros((10, 2, 4))
    fdm = FdmArrays(*parameters.values())
    for kind, curves, broken in (
        ("", fdm._replace(width=short), state),
        ("first ", fdm, AdamState({**state.first, "fdm_width": short}, state.second, state.step)),
        ("second ", fdm, AdamState(state.first, {**state.second, "fdm_width": short}, state.step)),
    ):
        with pytest.raises(ValueError, match=f"^{kind}fdm_width: expected C-contiguous"):
            deformation_adam_step(out, curves, saved, broken, rates, *BETAS)


def test_a_frame_midway_between_two_time_bases_moves_their_weights_and_hardly_its_own_offset():
    """Specification B1: with the first widths of `paper`, the basis value there is below 1e-10."""
    basis = np.exp(-(((1 / 32) ** 2 / 2e-4) ** 2))
    weight = np.zeros(1)
    state = adam_state({"w": weight})
    adam_update(state, {"w": weight}, {"w": np.full(1, 1e-4 * basis)}, {"w": 1.6e-3}, *BETAS)
    assert basis < 1e-10 and abs(weight[0]) > 0.8 * 1.6e-3 and abs(weight[0] * basis) < 1e-12
