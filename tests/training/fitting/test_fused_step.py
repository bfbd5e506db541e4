"""The fused sweeps of the optimiser against reverse pass, penalty and Adam one after the other, bit by bit."""

import msgspec
import numpy as np
import pytest

from endotsr.config import PAPER
from endotsr.method.equations.atom_sums import spread
from endotsr.method.equations.deformation import GAUSSIANS_PER_PIECE as PIECE
from endotsr.method.equations.deformation import deformation_reverse
from endotsr.method.equations.matern import MaternSaved, matern_penalty_reverse, penalty_factors
from endotsr.method.splatting.render import RenderGrads
from endotsr.training.fitting.adam import AdamState, adam_state, adam_update
from endotsr.training.fitting.fused.coefficients import coefficients_adam_step
from endotsr.training.fitting.fused.deformation import NAMES
from endotsr.training.fitting.fused.step import optimise
from endotsr.training.fitting.model import scene_at, scene_reverse, spectral_from
from endotsr.training.fitting.schedules import learning_rates
from endotsr.training.scene import workload
from endotsr.training.scene.gaussians import arrays

BETAS = (0.9, 0.999, 1e-15)
F = 3


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def _case(rng, dtype, count):
    coefficients = rng.normal(size=(3, 2 * F, count)).astype(dtype)
    return coefficients, rng.normal(size=2 * F).astype(dtype), rng.uniform(0.2, 2.0, F)


def _separate(d_sums, atoms, weight, rho, parameter, state, rates):
    gradient, _ = spread(d_sums, parameter, atoms, atom_gradient=False)
    if weight > 0:
        gradient += matern_penalty_reverse(weight, MaternSaved(parameter, rho))
    adam_update(state, {"c": parameter}, {"c": gradient}, rates, *BETAS)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("count", [1, 7, PIECE, PIECE + 6])
@pytest.mark.parametrize("weight", [0.0, 40.0])
def test_fused_step_of_coefficients_equals_reverse_penalty_then_adam_bitwise(rng, dtype, count, weight):
    start, atoms, rho = _case(rng, dtype, count)
    separate, fused = start.copy(), start.copy()
    states = [adam_state({"c": separate}), adam_state({"c": fused})]
    for k in range(3):
        d_sums, rates = rng.normal(size=(3, count)).astype(dtype), {"c": 0.01 / (k + 1)}
        _separate(d_sums, atoms, weight, rho, separate, states[0], rates)
        shrink = penalty_factors(weight, rho, count, start.dtype) if weight > 0 else None
        coefficients_adam_step(d_sums, atoms, shrink, fused, states[1], "c", rates, *BETAS)
    assert states[0].step == states[1].step == {"c": 3}
    assert not np.array_equal(start, fused)
    np.testing.assert_array_equal(separate, fused)
    np.testing.assert_array_equal(states[0].first["c"], states[1].first["c"])
    np.testing.assert_array_equal(states[0].second["c"], states[1].second["c"])


def test_fused_step_of_coefficients_without_gaussians():
    empty = np.zeros((3, 2 * F, 0))
    state = adam_state({"c": empty})
    shrink = penalty_factors(0.1, np.ones(F), 0, empty.dtype)
    coefficients_adam_step(np.zeros((3, 0)), np.ones(2 * F), shrink, empty, state, "c", {"c": 0.1}, *BETAS)
    assert state.step == {"c": 1}


def test_fused_step_of_coefficients_refuses_what_does_not_fit(rng):
    parameter, atoms, _ = _case(rng, np.float64, 4)
    state, rates = adam_state({"c": parameter}), {"c": 0.1}
    for d_sums, given, shrink in ((np.zeros((3, 5)), atoms, None), (np.zeros((3, 4)), atoms[1:], None),
                                  (np.zeros((3, 4)), atoms, atoms[1:])):  # fmt: skip
        with pytest.raises(ValueError, match="c \\(3, 6, 4\\): got"):
            coefficients_adam_step(d_sums, given, shrink, parameter, state, "c", rates, *BETAS)
    apart = np.zeros((3, 2 * F, 8))[:, :, ::2]
    for broken in (AdamState({"c": apart}, state.second, state.step), AdamState(state.first, {"c": apart}, state.step)):
        with pytest.raises(ValueError, match=r"c: expected C-contiguous .* got strided"):
            coefficients_adam_step(np.zeros((3, 4)), atoms, None, parameter, broken, "c", rates, *BETAS)
    with pytest.raises(ValueError, match="float64 \\(3, 6, 4\\)"):
        single = AdamState({"c": np.zeros((3, 2 * F, 4), np.float32)}, state.second, state.step)
        coefficients_adam_step(np.zeros((3, 4)), atoms, None, parameter, single, "c", rates, *BETAS)


@pytest.mark.parametrize("weight", [0.0, 500.0])
def test_a_step_of_everything_equals_the_gradients_of_the_definition_put_to_adam(rng, weight):
    """All components on: the penalty reaches the motion alone, and every array moves at its own rate."""
    loss = msgspec.structs.replace(PAPER.loss, lambda_msp=weight)
    config = msgspec.structs.replace(PAPER, loss=loss)
    gaussians = workload.gaussians(50, config)
    own = {n: rng.normal(0, 0.1, np.shape(a)).astype(a.dtype) for n, a in arrays(gaussians).items() if "coeff" in n}
    gaussians = gaussians._replace(**own)
    copy = gaussians._replace(**{name: a.copy() for name, a in arrays(gaussians).items()})
    adams = [adam_state(arrays(gaussians)), adam_state(arrays(copy))]
    spectral, rates = spectral_from(config.model, np.arange(8) / 8), learning_rates(3500, config)
    scene, saved = scene_at(gaussians, spectral, config.model, 0.3)
    grads = _gradients(rng, scene)

    back = scene_reverse(grads, saved)
    fdm = deformation_reverse(back.d_offsets, saved.deformation)
    by_field = back.by_field | dict(zip(NAMES, fdm[:3], strict=True))
    if weight > 0:
        extra = matern_penalty_reverse(weight, MaternSaved(gaussians.motion_coefficients, spectral.rho))
        by_field["motion_coefficients"] += extra
    assert by_field.keys() == arrays(copy).keys()
    adam_update(adams[1], arrays(copy), by_field, rates, *BETAS)

    few = scene_reverse(grads, saved, coefficients=False)
    assert few.by_field.keys() == back.by_field.keys() - {"appearance_coefficients", "motion_coefficients"}
    ahead = optimise(gaussians, adams[0], spectral, config, saved, grads, few, rates, 0.7)
    later, _ = scene_at(copy, spectral, config.model, 0.7)
    for here, there in zip(scene_at(gaussians, spectral, config.model, 0.7, ahead)[0], later, strict=True):
        np.testing.assert_array_equal(here, there)
    assert adams[0].step == adams[1].step
    for name, array in arrays(copy).items():
        np.testing.assert_array_equal(arrays(gaussians)[name], array, err_msg=name)
        np.testing.assert_array_equal(adams[0].first[name], adams[1].first[name], err_msg=name)
        np.testing.assert_array_equal(adams[0].second[name], adams[1].second[name], err_msg=name)


def _gradients(rng, scene):
    made = {f"d_{n}": rng.normal(size=np.shape(a)).astype(a.dtype) for n, a in scene._asdict().items()}
    count = scene.position.shape[1]
    none = {"d_background": None, "d_camera": None}
    return RenderGrads(**made, d_mean2d=np.zeros((2, count)), visible=np.ones(count, bool), **none)
