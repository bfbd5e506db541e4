"""The training: one view per iteration, on the published schedule (specification, equation 6 and B10-B12).

One iteration is `view_pass` (`training/fitting/view.py`), which ends at the gradients of the deformed scene, and then
`optimise`, which fuses the reverse passes of the time bases and of the Fourier coefficients with their Adam step.
`optimise`, `_optimise_frames` and density control are the only places where parameters change. No result depends on
the number of threads.
"""

import math
from collections.abc import Callable, Mapping
from typing import cast

import msgspec
import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config
from endotsr.method.equations.matern import matern_penalty_forward
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.threads import parallel_calls
from endotsr.method.kernels.timer import NO_TIMER, Timer, timed
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderGrads, RenderOut
from endotsr.training.fitting.adam import adam_update, add_array, regather
from endotsr.training.fitting.bridged import TargetsAhead
from endotsr.training.fitting.coarse_start import coarse_ends, coarse_start
from endotsr.training.fitting.divergence import Diverged, DivergenceWatch, not_finite
from endotsr.training.fitting.fused.step import optimise
from endotsr.training.fitting.model import SceneGrads, SceneSaved, scene_reverse
from endotsr.training.fitting.objective import ImageLoss, LossWeights, Targets, calibrate_on, full_weights
from endotsr.training.fitting.records import LogEntry, RngState
from endotsr.training.fitting.sampling import View, drawn_view
from endotsr.training.fitting.schedules import (
    active_degree,
    densifications_left,
    densify_now,
    laplacian_ramp,
    learning_rates,
    residuals_activate,
    smoothness_active,
    statistics_active,
)
from endotsr.training.fitting.state import (
    TrainingConstants,
    TrainingState,
    check_state,
    new_training,
    training_constants,
)
from endotsr.training.fitting.view import view_pass
from endotsr.training.scene.density_control import densify, gather_statistics
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.initialisation import activate_residuals
from endotsr.training.scene.parameters import (
    Exposure,
    Pose,
    exposure_gradients,
    exposure_of,
    pose_at,
    pose_gradients,
    trained,
)

OnIteration = Callable[[LogEntry], None]

WATCHED_GRADIENTS = ("d_position", "d_log_scale", "d_quaternion", "d_opacity_logit")
PSNR_EVERY = 10  # iterations between two training PSNRs in the log; each costs a pass over the image


def train(
    state: TrainingState,
    sequence: Sequence,
    config: Config,
    on_iteration: OnIteration,
    on_checkpoint: Callable[[TrainingState], None],
    *,
    on_message: Callable[[str], object] = print,
) -> TrainingState:
    """Run to `config.training.iterations`; the state is updated in place and returned.

    With lambda_lap = "auto" and no weight yet, the base model is first trained to K_s and calibrated (equation 7).
    This pre-training is not checkpointed: after an interruption it restarts and gives the same weight.
    Raises: Diverged (a FloatingPointError) with iteration, frame and term if a loss or a gradient is not finite; no
            parameter and no moment has then changed since the previous iteration. ValueError with array and index if a
            parameter of the state is not finite. Errors of the calibration as in `calibrated_weight`.
    """
    check_state(state)
    watch = DivergenceWatch(state.gaussians)
    if state.lambda_lap is None and config.model.laplacian:
        on_message(f"calibration: training the base model to iteration {config.training.residual_activation} first")
        state.lambda_lap = calibrated_weight(sequence, config)
        on_message(f"calibration: lambda_lap = {state.lambda_lap:.4g}")
    if state.iteration == 0 and state.gaussians.count > config.density.maximum:
        first = f"density.maximum = {config.density.maximum} is below the {state.gaussians.count} first points"
        on_message(f"{first}: they are kept, and none is added before as many are removed")
    coarse = coarse_start(sequence, config) if state.coarse else None
    if coarse:
        on_message("coarse start: half-size frames until the fit error is below the detail that they lack")
    constants = coarse.constants if coarse else training_constants(sequence, config)
    with TargetsAhead() as ahead:
        ahead.follow(constants.bridged)
        while state.iteration < config.training.iterations:
            if coarse and coarse_ends(state, coarse):
                coarse, state.coarse, constants = None, False, training_constants(sequence, config)
                ahead.follow(constants.bridged)
                on_message(f"coarse start: full-size frames after iteration {state.iteration}")
            entry = training_step(state, constants)
            state.making = constants.bridged.making
            on_iteration(entry)
            if advice := watch.see(entry, state.gaussians):
                on_message(advice)
            if state.iteration % config.training.checkpoint_every == 0:
                on_checkpoint(state)
    return state


def calibrated_weight(sequence: Sequence, config: Config) -> float:
    """lambda_lap of equation (7): base model (no A, S, L) to iteration K_s on this sequence, then calibrate.

    Raises: FloatingPointError with iteration, frame and term if a loss or a gradient of the base model is not finite;
            CalibrationError if equation (7) has no solution.
    """
    model = msgspec.structs.replace(config.model, appearance=False, spectral_motion=False, laplacian=False)
    loss = msgspec.structs.replace(config.loss, lambda_lap=0.0)
    base = msgspec.structs.replace(config, model=model, loss=loss)
    constants, state = training_constants(sequence, base), new_training(sequence, base)
    try:
        while state.iteration < config.training.residual_activation:
            training_step(state, constants)
    except Diverged as error:  # of another state than that of the run, whose diverged.npz could not repeat it
        raise FloatingPointError(f"calibration of loss.lambda_lap: {error}") from None
    return calibrate_on(state.gaussians, constants.spectral, sequence, base, state.frames).lambda_lap


def training_step(state: TrainingState, constants: TrainingConstants, timer: Timer = NO_TIMER) -> LogEntry:
    """One iteration; returns its log entry."""
    config, iteration = constants.config, state.iteration + 1
    if residuals_activate(iteration, config):
        _activate_residuals(state, config)
    state.drawn = state.drawn or drawn_view(state.rng, constants.sequence, config.training)
    view, rng_state = state.drawn
    targets, camera = constants.observed(view)
    found = view_pass(
        state.gaussians, constants.spectral, targets, _weights(state, iteration, config), config, camera, view.t,
        exposure=exposure_of(state.frames, constants.column(view)), pose=pose_at(state.frames, view.t),
        degree=active_degree(iteration, config), ahead=state.ahead, timer=timer,
    )  # fmt: skip
    loss, d_scene = found.loss, found.d_scene
    gradients = {name: getattr(d_scene, name) for name in WATCHED_GRADIENTS}
    _refuse_not_finite(iteration, view, {**loss.terms, "loss": loss.loss}, gradients, rng_state)
    watched = statistics_active(iteration, config)
    back, penalty, _ = parallel_calls(
        lambda: scene_reverse(d_scene, found.scene_saved, coefficients=False),
        timed(timer, "Fourier", lambda: _matern_penalty(state.gaussians, constants)),
        timed(timer, "density control", lambda: _watch_density(state, d_scene, found.camera, watched)),
    )
    _refuse_not_finite(iteration, view, {"matern_penalty": penalty or 0.0}, {}, rng_state)
    entry = _log_entry(iteration, view, loss, penalty, found.rendered, targets, state, config)
    dense, state.ahead = densify_now(iteration, config), None
    state.drawn = None
    if not (dense and config.optimiser.legacy_skip):
        _optimise(state, constants, found.scene_saved, d_scene, back, iteration, timer)
        _optimise_frames(state, constants, view, found.d_exposure, found.d_pose, iteration)
    if dense:
        with timer.stage("density control"):
            _control_density(state, constants, iteration)
    state.iteration = iteration
    return entry


def _weights(state: TrainingState, iteration: int, config: Config) -> LossWeights:
    """The weights of the image terms at this iteration."""
    weights = full_weights(config.loss, laplacian_ramp(iteration, config) * (state.lambda_lap or 0.0))
    return weights if smoothness_active(iteration, config) else weights._replace(smoothness=0.0)


def _activate_residuals(state: TrainingState, config: Config) -> None:
    """Activate the spectral residuals with zero coefficients, zero moments and step 0."""
    model = config.model
    state.gaussians = activate_residuals(state.gaussians, model.frequencies, model.appearance, model.spectral_motion)
    for name in ("appearance_coefficients", "motion_coefficients"):
        array = getattr(state.gaussians, name)
        if array is not None and name not in state.adam.first:  # tracked motion has moments from the start
            add_array(state.adam, name, array)


def _matern_penalty(gaussians: Gaussians, constants: TrainingConstants) -> float | None:
    """L_msp; None without component S. Its gradient is added in `optimise`."""
    coefficients = gaussians.motion_coefficients
    return None if coefficients is None else matern_penalty_forward(coefficients, constants.spectral.rho)[0]


def _watch_density(state: TrainingState, d_scene: RenderGrads, camera: Camera, active: bool) -> None:
    """Add this view to the density statistics."""
    if active:
        gather_statistics(state.statistics, d_scene.d_mean2d, d_scene.visible, camera.width, camera.height)


def _optimise(
    state: TrainingState,
    constants: TrainingConstants,
    saved: SceneSaved,
    d_scene: RenderGrads,
    back: SceneGrads,
    iteration: int,
    timer: Timer,
) -> None:
    """One Adam step of the Gaussians; also draws the next view and computes the offsets at its time.

    No view is drawn before density control, which must draw its random numbers first, or after the last iteration.
    """
    config, later = constants.config, None
    if iteration < config.training.iterations and not densify_now(iteration, config):
        state.drawn = drawn_view(state.rng, constants.sequence, config.training)
        later = state.drawn.view.t
    rates = learning_rates(iteration, config)
    gaussians, adam, spectral = state.gaussians, state.adam, constants.spectral
    state.ahead = optimise(gaussians, adam, spectral, config, saved, d_scene, back, rates, later, timer)


def _optimise_frames(
    state: TrainingState,
    constants: TrainingConstants,
    view: View,
    d_exposure: Exposure | None,
    d_pose: Pose | None,
    iteration: int,
) -> None:
    """One Adam step of the frame parameters: all columns, with gradient 0 for unseen frames."""
    if state.frames is None:
        return
    gradients, o = {}, constants.config.optimiser
    if d_exposure is not None:
        gradients |= exposure_gradients(state.frames, constants.column(view), d_exposure)
    if d_pose is not None:
        gradients |= pose_gradients(state.frames, view.t, d_pose)
    rates = constants.in_scene_units(learning_rates(iteration, constants.config))
    adam_update(state.adam, trained(state.frames), gradients, rates, o.beta1, o.beta2, o.epsilon)


def _control_density(state: TrainingState, constants: TrainingConstants, iteration: int) -> None:
    """Clone, split and prune; gather the moments. Clones and children have zero moments; all statistics are zeroed."""
    left = densifications_left(iteration, constants.config)
    result = densify(state.gaussians, state.statistics, constants.config.density, state.rng, constants.extent, left)
    regather(state.adam, arrays(result.gaussians), result.plan.source, result.plan.survivors)
    state.gaussians, state.statistics = result.gaussians, result.statistics


def _refuse_not_finite(
    iteration: int,
    view: View,
    terms: Mapping[str, float],
    gradients: Mapping[str, FloatArray | None],
    rng_state: RngState,
) -> None:
    """Raise `Diverged` for the first non-finite loss term or gradient, before any parameter or moment is updated."""
    broken = next(((name, str(float(v))) for name, v in terms.items() if not math.isfinite(v)), None)
    broken = broken or not_finite(gradients)
    if broken:
        raise Diverged(iteration, view.index, *broken, rng_state)


def _log_entry(
    iteration: int,
    view: View,
    loss: ImageLoss,
    penalty: float | None,
    rendered: RenderOut,
    targets: Targets,
    state: TrainingState,
    config: Config,
) -> LogEntry:
    """The log entry of an iteration."""
    total = float(loss.loss) + config.loss.lambda_msp * (penalty or 0.0)
    terms = {name: float(value) for name, value in loss.terms.items()}
    entry = cast(LogEntry, {"iteration": iteration, "frame": view.index, "loss": total, **terms})
    if penalty is not None:
        entry["matern_penalty"] = penalty
    if iteration % PSNR_EVERY == 0 or iteration == 1:
        entry["psnr"] = tissue_psnr(rendered.colour, targets)
    entry["gaussians"] = state.gaussians.count
    return entry


def tissue_psnr(colour: FloatArray, targets: Targets) -> float | None:
    """PSNR over the tissue pixels of the clipped render, dB; None without tissue or for a perfect render."""
    difference = np.clip(colour, 0, 1) - targets.image
    square = np.einsum("chw,chw,hw->", difference, difference, targets.mask, dtype=np.float64)
    count = 3 * int(np.count_nonzero(targets.mask))
    return -10.0 * math.log10(square / count) if square > 0 and count > 0 else None
