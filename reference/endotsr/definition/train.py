"""A whole training, equations (6) and (B10) to (B12), on the schedule of the paper."""

from collections import namedtuple

import numpy as np

from endotsr.definition import schedules
from endotsr.definition.adam import adam_state, adam_update
from endotsr.definition.calibration import calibrate, calibration_views, rms
from endotsr.definition.density_control import densify, empty_statistics, gather_statistics, scene_extent
from endotsr.definition.exposure import EXPOSURES
from endotsr.definition.initialisation import activate_residuals, initialise
from endotsr.definition.laplacian import laplacian_loss_forward, laplacian_loss_reverse
from endotsr.definition.metrics import psnr_tissue
from endotsr.definition.objective import Frame, frame_targets, full_weights, no_edges, photometric_loss
from endotsr.definition.render import render_forward
from endotsr.definition.scene import arrays, scene_at, spectral_from
from endotsr.definition.settings import PAPER
from endotsr.definition.view import view_gradients

State = namedtuple("State", "gaussians adam statistics iteration exposures")  # what an iteration changes


def start(gaussians, exposures=None):
    """Zero moments and empty statistics; `exposures` as `no_exposures` gives them, None without the option (B13)."""
    exposures = exposures or {}
    adam = adam_state(arrays(gaussians) | exposures)
    return State(gaussians, adam, empty_statistics(gaussians.opacity_logit.size), 0, exposures)


def no_exposures(model, frames):
    """The identity for every training frame (B13), by name; empty without the option."""
    return {name: np.zeros((3, frames)) for name in EXPOSURES} if model.exposure else {}


def in_column(vectors, k, exposures):
    """Gradients of all exposures from those of training frame k: 0 for every other frame."""
    found = {name: np.zeros_like(array) for name, array in exposures.items()}
    for array, vector in zip(found.values(), vectors or ()):
        array[:, k] = vector
    return found


def frame_of(sequence, k):
    """Frame k with its colours in [0, 1]."""
    depth = sequence.depth[k].astype(float)
    return Frame(sequence.images[k] / 255, sequence.masks[k], depth, sequence.times[k], sequence.cameras[k])


def weights_at(iteration, config):
    """Weights of the image terms at this iteration."""
    weights = full_weights(config.loss, schedules.laplacian_ramp(iteration, config) * config.loss.lambda_lap)
    return weights if schedules.smoothness_active(iteration, config) else weights._replace(smoothness=0.0)


def activated(state, config):
    """The state with those of A and C that are on added as zeros, with zero moments."""
    model = config.model
    gaussians = activate_residuals(state.gaussians, model.frequencies, model.appearance, model.spectral_motion)
    return state._replace(gaussians=gaussians, adam=adam_state(arrays(gaussians)) | state.adam)


def stepped(state, view, k, i, config):
    """The state after the Adam step of all parameters; k is the position of the frame among the training frames."""
    o = config.optimiser
    parameters = arrays(state.gaussians) | state.exposures
    gradients = view.gradients | in_column(view.d_exposure, k, state.exposures)
    rates = schedules.learning_rates(i, config)
    adam, parameters = adam_update(state.adam, parameters, gradients, rates, o.beta1, o.beta2, o.epsilon)
    exposures = {name: parameters.pop(name) for name in state.exposures}
    return state._replace(gaussians=state.gaussians._replace(**parameters), adam=adam, exposures=exposures)


def iterate(state, sequence, spectral, config, rng, raster=PAPER, edges=no_edges):
    """One iteration on a uniformly drawn training frame: the new state and the ViewGradients."""
    i = state.iteration + 1
    if schedules.residuals_active(i, config) and not schedules.residuals_active(i - 1, config):
        state = activated(state, config)
    k = rng.integers(len(sequence.train_index))
    frame = frame_of(sequence, sequence.train_index[k])
    exposure = [array[:, k] for array in state.exposures.values()] or None
    view = view_gradients(
        state.gaussians, spectral, frame_targets(frame, config), weights_at(i, config), config, frame.camera,
        frame.time, edges, exposure=exposure, raster=raster, degree=schedules.active_degree(i, config),
    )  # fmt: skip
    statistics = state.statistics
    if schedules.statistics_active(i, config):
        statistics = gather_statistics(statistics, view.d_mean2d, view.visible, frame.camera.width, frame.camera.height)
    if not (schedules.densify_now(i, config) and config.optimiser.legacy_skip):
        state = stepped(state, view, k, i, config)
    state = state._replace(statistics=statistics, iteration=i)
    return controlled(state, sequence, config, rng) if schedules.densify_now(i, config) else state, view


def controlled(state, sequence, config, rng):
    """The state after density control: new Gaussians have moments 0, all statistics are 0."""
    cameras = [sequence.cameras[k] for k in sequence.train_index]
    extent = scene_extent(config.density, cameras)
    left = schedules.densifications_left(state.iteration, config)
    made = densify(state.gaussians, state.statistics, config.density, rng, extent, left)
    new = np.arange(made.plan.source.size) >= made.plan.survivors
    adam = {
        name: (*(np.where(new, 0, moment[..., made.plan.source]) for moment in (m, v)), k)
        for name, (m, v, k) in state.adam.items()
        if name not in state.exposures
    }
    return state._replace(gaussians=made.gaussians, adam=state.adam | adam, statistics=made.statistics)


def calibrated_weight(gaussians, spectral, sequence, config, raster=PAPER):
    """lambda_lap of equation (7), from training views rendered without A and S, and here without exposures (B13)."""
    base = gaussians._replace(appearance_coefficients=None, motion_coefficients=None)
    views = []
    chosen = calibration_views(len(sequence.train_index), config.loss.calibration_views)
    for k in sequence.train_index[chosen]:
        frame = frame_of(sequence, k)
        targets = frame_targets(frame, config)
        scene, _ = scene_at(base, spectral, config.model, frame.time)
        colour = render_forward(scene, frame.camera, raster, degree=config.model.harmonics_degree)[0].colour
        _, _, d_rgb = photometric_loss(colour, targets, config.loss.ssim_weight)
        _, saved = laplacian_loss_forward(colour, targets.image, targets.supports, config.loss.upsampling)
        views.append((k, rms(d_rgb), rms(laplacian_loss_reverse(1.0, saved))))
    return calibrate(views, config.loss.gradient_ratio).lambda_lap


def train(sequence, config, rng, raster=PAPER, on_iteration=lambda state, view: None):
    """Gaussians and Spectral after all iterations, initialised from the depth of the training frames.

    The edges of (B9) are empty, by `no_edges`; exposures (B13) are trained and not returned.
    """
    exposures = no_exposures(config.model, len(sequence.train_index))
    state = start(initialise(sequence, config.initialisation, config.model, rng), exposures)
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    while state.iteration < config.training.iterations:
        state, view = iterate(state, sequence, spectral, config, rng, raster)
        on_iteration(state, view)
    return state.gaussians, spectral


def evaluate(gaussians, spectral, sequence, config, indices, raster=PAPER):
    """Mean PSNR (M1) over tissue of some frames, dB; the render is clipped to [0, 1] and has no exposure (B13)."""
    found = []
    for frame in (frame_of(sequence, k) for k in indices):
        scene, _ = scene_at(gaussians, spectral, config.model, frame.time)
        rendered, _ = render_forward(scene, frame.camera, raster, degree=config.model.harmonics_degree)
        found.append(psnr_tissue(np.clip(rendered.colour, 0, 1), frame.image, frame.mask))
    return np.mean(found)
