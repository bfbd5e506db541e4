"""One readable training view: the fused step of training equals its gradients put to Adam, bit by bit."""

import copy
import dataclasses

import msgspec
import numpy as np
import pytest

from endotsr.clips.opencv.filters import canny_edges
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import (
    Config,
    DensityConfig,
    InitialisationConfig,
    LossConfig,
    ModelConfig,
    RasterConfig,
    TrainingConfig,
)
from endotsr.training.fitting.adam import adam_update
from endotsr.training.fitting.objective import full_weights
from endotsr.training.fitting.sampling import drawn_view
from endotsr.training.fitting.schedules import learning_rates
from endotsr.training.fitting.state import new_training, training_constants
from endotsr.training.fitting.trainer import training_step
from endotsr.training.fitting.view import view_gradients
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.parameters import exposure_gradients, exposure_of, pose_at, pose_gradients, trained


def settings(precision="float32", **model) -> Config:
    """Every component and every term takes part from iteration 3 on; no density control."""
    return Config(
        model=ModelConfig(**({"bases": 4, "frequencies": 2, "initial_width": 0.1, "exposure": True} | model)),
        loss=LossConfig(smoothness_from=1, smoothness_weight=0.01, laplacian_from=0, laplacian_full=1, lambda_msp=5.0),
        raster=RasterConfig(),
        density=DensityConfig(start=100, interval=100, until=101),
        initialisation=InitialisationConfig(first_frame_points=200, other_frame_points=40),
        training=TrainingConfig(iterations=12, residual_activation=2, harmonics_interval=2, precision=precision),
    )


@pytest.fixture(scope="module")
def sequence():
    return simulate(SimulatorSettings(width=48, height=32, frames=8)).sequence


@pytest.fixture(scope="module")
def turning(sequence):
    """The same frames with a pose for each."""
    cameras = [
        camera._replace(translation=camera.translation + [0.1 * i, 0, 0]) for i, camera in enumerate(sequence.cameras)
    ]
    return dataclasses.replace(sequence, cameras=cameras, static_camera=False)


def warm(sequence, config, iterations):
    """State and training_constants after some iterations: coefficients, moments and exposures are off zero."""
    state, constants = new_training(sequence, config), training_constants(sequence, config)
    for _ in range(iterations):
        training_step(state, constants)
    return state, constants


def plain_step(state, constants):
    """The documented gradients of the next view, then Adam; the state is changed in place."""
    config, iteration = constants.config, state.iteration + 1
    index, t, _ = (state.drawn or drawn_view(copy.deepcopy(state.rng), constants.sequence, config.training)).view
    column = int(np.flatnonzero(constants.sequence.train_index == index)[0])
    loss, o = config.loss, config.optimiser
    weights = full_weights(loss, state.lambda_lap)
    view = view_gradients(
        state.gaussians, constants.spectral, constants.targets_of(index), weights, config,
        constants.sequence.cameras[index], t,
        exposure=exposure_of(state.frames, column), pose=pose_at(state.frames, t), degree=min(3, iteration // 2),
    )  # fmt: skip
    gradients = dict(view.gradients)
    if view.d_exposure is not None:
        gradients |= exposure_gradients(state.frames, column, view.d_exposure)
    if view.d_pose is not None:
        gradients |= pose_gradients(state.frames, t, view.d_pose)
    parameters = arrays(state.gaussians) | trained(state.frames)
    rates = learning_rates(iteration, config)
    if config.model.pose_correction:
        rates["pose_translation"] *= constants.depth
    adam_update(state.adam, parameters, gradients, rates, o.beta1, o.beta2, o.epsilon)
    return index, view


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("frames", ["none", "exposure", "poses", "both"])
def test_a_step_of_training_equals_the_view_gradients_put_to_adam_bitwise(sequence, turning, precision, frames):
    poses = frames in ("poses", "both")
    config = settings(precision, exposure=frames in ("exposure", "both"), pose_correction=poses)
    state, constants = warm(turning if poses else sequence, config, 6)
    plain = copy.deepcopy(state)
    index, view = plain_step(plain, constants)
    entry = training_step(state, constants)
    assert (entry["frame"], entry["loss"]) == (index, view.loss)
    assert set(view.terms) == {"l1", "ssim", "depth", "smoothness", "laplacian", "matern_penalty"}
    assert {name: entry[name] for name in view.terms} == view.terms
    assert view.gradients.keys() == set(Gaussians._fields) and all(g.any() for g in view.gradients.values())
    assert state.adam.step == plain.adam.step
    for name, array in (arrays(plain.gaussians) | trained(plain.frames)).items():
        fused = (arrays(state.gaussians) | trained(state.frames))[name]
        assert fused.dtype == precision
        np.testing.assert_array_equal(fused, array, err_msg=name)
        np.testing.assert_array_equal(state.adam.first[name], plain.adam.first[name], err_msg=name)
        np.testing.assert_array_equal(state.adam.second[name], plain.adam.second[name], err_msg=name)


def view_of(state, constants, edges=None):
    targets, camera = constants.targets_of(0), constants.sequence.cameras[0]
    weights = full_weights(constants.config.loss, 0.8)._replace(smoothness=0.5)
    return view_gradients(state.gaussians, constants.spectral, targets, weights, constants.config, camera, 0.2, edges)


def test_given_edges_take_the_place_of_the_detected_ones(sequence):
    state, constants = warm(sequence, settings(), 3)
    default = view_of(state, constants)
    detected = canny_edges(default.rendered.depth)
    same, none = view_of(state, constants, detected), view_of(state, constants, np.ones_like(detected))
    assert same.loss == default.loss
    np.testing.assert_array_equal(same.gradients["position"], default.gradients["position"])
    assert none.terms["smoothness"] != default.terms["smoothness"]


def test_a_component_that_is_off_has_no_gradient_and_no_term(sequence):
    state, constants = warm(sequence, settings(appearance=False, spectral_motion=False, deformation=False), 3)
    view = view_of(state, constants)
    assert view.gradients.keys() == arrays(state.gaussians).keys()
    assert "matern_penalty" not in view.terms and view.d_exposure is None


def test_degree_of_the_model_is_the_default(sequence):
    state, constants = warm(sequence, settings(), 8)
    high = msgspec.structs.replace(constants.config.model, harmonics_degree=0)
    flat = msgspec.structs.replace(constants.config, model=high)
    assert view_of(state, constants).gradients["harmonics"].shape[0] == 16
    constants.config = flat
    assert not view_of(state, constants).gradients["harmonics"][1:].any()
