"""The training: one view an iteration, on the published schedule (specification, equation 6 and B10-B12).

`TrainingState` is all that a run carries from one iteration to the next and, but for `ahead`, which is then computed
anew, all that a checkpoint holds; everything else (targets, atoms, rates) is a function of the state, the sequence and
the configuration. So a resumed run equals an uninterrupted one bit by bit, and no result depends on the number of
threads.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config
from endotsr.equations.matern import matern_penalty_forward
from endotsr.fitting.adam import AdamState, adam_state, add_array
from endotsr.fitting.checkpoint import Checkpoint, restore_rng, save_checkpoint
from endotsr.fitting.fused.step import optimise
from endotsr.fitting.model import OffsetsAhead, Spectral, raster_settings, scene_at, scene_reverse, spectral_from
from endotsr.fitting.objective import ImageLoss, LossWeights, Targets, calibrate_on, frame_targets, image_loss
from endotsr.fitting.schedules import (
    active_degree,
    densify_now,
    laplacian_ramp,
    learning_rates,
    residuals_activate,
    smoothness_active,
    statistics_active,
)
from endotsr.kernels.memory import keep_freed_memory
from endotsr.kernels.threads import parallel_calls
from endotsr.scene.density_control import (
    DensityStatistics,
    densify,
    empty_statistics,
    gather_statistics,
    scene_extent,
)
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.scene.initialisation import activate_residuals, initialise
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import RenderGrads, RenderOut, check_finite, render_forward, render_reverse

FloatArray = NDArray[np.floating]
OnIteration = Callable[[dict[str, Any]], None]

PSNR_EVERY = 10  # iterations between training PSNRs in the log: the figure costs a pass over the image


class Timer(Protocol):
    """What a benchmark hands in to see where the time goes."""

    def mark(self, stage: str) -> None:
        """The stage of this name has just ended."""


class _NoTimer:
    def mark(self, stage: str) -> None:
        """Nothing to measure."""


NO_TIMER = _NoTimer()


@dataclass
class TrainingState:
    """Everything that a run carries from one iteration to the next."""

    gaussians: Gaussians
    adam: AdamState
    iteration: int  # completed iterations
    rng: np.random.Generator
    statistics: DensityStatistics
    lambda_lap: float | None  # full detail weight; None until an `auto` weight is calibrated
    ahead: OffsetsAhead | None = None  # taken while the FDM was changed; not part of a checkpoint


@dataclass
class Workshop:
    """What an iteration needs beside the state: functions of the sequence and the configuration."""

    sequence: Sequence
    config: Config
    spectral: Spectral
    extent: float
    targets: dict[int, Targets]  # by frame, filled at first use

    def targets_of(self, index: int) -> Targets:
        """The loss targets of a frame, made once."""
        if index not in self.targets:
            self.targets[index] = frame_targets(self.sequence.frame(index, self.config.training.precision), self.config)
        return self.targets[index]


def workshop(sequence: Sequence, config: Config) -> Workshop:
    """Spectral constants and scene extent of a sequence."""
    keep_freed_memory()
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    extent = scene_extent(config.density, [sequence.cameras[i] for i in sequence.train_index])
    return Workshop(sequence, config, spectral, extent, {})


def new_training(sequence: Sequence, config: Config) -> TrainingState:
    """Initialise from the training frames, seeded. Raises InputError when the frames hold no usable pixel."""
    rng = np.random.default_rng(config.training.seed)
    gaussians = initialise(sequence, config.initialisation, config.model, rng, np.dtype(config.training.precision))
    weight = config.loss.lambda_lap
    return TrainingState(
        gaussians,
        adam_state(arrays(gaussians)),
        0,
        rng,
        empty_statistics(gaussians.count),
        None if weight == "auto" else float(weight),
    )


def save_state(path: Path, state: TrainingState, config: Config) -> None:
    """Write a checkpoint, atomically.

    Raises: OSError, or FloatingPointError naming array and index if a parameter is not finite (its Gaussian would
            only vanish from the picture). The previous checkpoint is then intact.
    """
    try:
        check_finite(arrays(state.gaussians))
    except ValueError as error:
        raise FloatingPointError(f"iteration {state.iteration}: {error}; the last checkpoint is kept") from None
    header = {"config": msgspec.to_builtins(config), "lambda_lap": state.lambda_lap}
    generator = dict(state.rng.bit_generator.state)
    save_checkpoint(path, state.gaussians, state.adam, state.iteration, generator, state.statistics, header)


def state_from_checkpoint(checkpoint: Checkpoint, config: Config) -> TrainingState:
    """The state as it was saved. Raises InputError if its random state is not that of this generator."""
    rng = restore_rng(checkpoint.rng_state)
    weight = checkpoint.header.get("lambda_lap")
    if weight is None and config.loss.lambda_lap != "auto":
        weight = float(config.loss.lambda_lap)
    return TrainingState(
        checkpoint.gaussians, checkpoint.adam, checkpoint.iteration, rng, checkpoint.statistics, weight
    )


def train(
    state: TrainingState,
    sequence: Sequence,
    config: Config,
    on_iteration: OnIteration,
    on_checkpoint: Callable[[TrainingState], None],
    *,
    on_message: Callable[[str], None] = print,
) -> TrainingState:
    """Run to `config.training.iterations`; the state is changed in place and returned.

    With lambda_lap = "auto" and no weight yet, the base model is first trained to K_s and calibrated (equation 7).
    That pre-training is not checkpointed: interrupted, it starts again and gives the same weight.
    Raises: FloatingPointError naming iteration, frame and terms if the loss is not finite; ValueError naming array
            and index if the state holds a number that is not finite.
    """
    check_finite(arrays(state.gaussians))
    if state.lambda_lap is None and config.model.laplacian:
        on_message(f"calibration: training the base model to iteration {config.training.residual_activation} first")
        state.lambda_lap = calibrated_weight(sequence, config)
        on_message(f"calibration: lambda_lap = {state.lambda_lap:.4g}")
    shop = workshop(sequence, config)
    while state.iteration < config.training.iterations:
        on_iteration(training_step(state, shop))
        if state.iteration % config.training.checkpoint_every == 0:
            on_checkpoint(state)
    return state


def calibrated_weight(sequence: Sequence, config: Config) -> float:
    """lambda_lap of equation (7): base model (no A, S, L) to iteration K_s on this sequence, then calibrate."""
    model = msgspec.structs.replace(config.model, appearance=False, spectral_motion=False, laplacian=False)
    loss = msgspec.structs.replace(config.loss, lambda_lap=0.0)
    base = msgspec.structs.replace(config, model=model, loss=loss)
    shop, state = workshop(sequence, base), new_training(sequence, base)
    while state.iteration < config.training.residual_activation:
        training_step(state, shop)
    return calibrate_on(state.gaussians, shop.spectral, sequence, base).lambda_lap


def training_step(state: TrainingState, shop: Workshop, timer: Timer = NO_TIMER) -> dict[str, Any]:
    """One iteration; returns its log entry."""
    config, iteration = shop.config, state.iteration + 1
    if residuals_activate(iteration, config):
        _activate_residuals(state, config)
    index, t = _draw_view(state.rng, shop)
    targets = shop.targets_of(index)
    camera = shop.sequence.cameras[index]
    timer.mark("view")
    scene, scene_saved = scene_at(state.gaussians, shop.spectral, config.model, t, state.ahead)
    timer.mark("scene")
    settings = raster_settings(config)
    rendered, render_saved = render_forward(scene, camera, settings, degree=active_degree(iteration, config))
    timer.mark("render")
    loss = image_loss(rendered, targets, _weights(state, iteration, config), config.loss)
    timer.mark("losses")
    grads = render_reverse(loss.d_colour, loss.d_depth, None, render_saved)
    timer.mark("render reverse")
    back, penalty, _ = parallel_calls(
        lambda: scene_reverse(grads, scene_saved, coefficients=False),
        lambda: _spectral_penalty(state.gaussians, shop),
        lambda: _watch_density(state, grads, camera, statistics_active(iteration, config)),
    )
    timer.mark("scene reverse")
    entry = _log_entry(iteration, index, loss, penalty, rendered, targets, state, config)
    dense, state.ahead = densify_now(iteration, config), None
    if not (dense and config.optimiser.legacy_skip):
        rates = learning_rates(iteration, config)
        later = _next_time(state.rng, shop) if iteration < config.training.iterations and not dense else None
        state.ahead = optimise(
            state.gaussians, state.adam, shop.spectral, config, scene_saved, grads, back, rates, later
        )
    timer.mark("optimiser")
    if dense:
        _control_density(state, shop)
        timer.mark("density control")
    state.iteration = iteration
    return entry


def _draw_view(rng: np.random.Generator, shop: Workshop) -> tuple[int, float]:
    """A training frame, uniform with replacement, and its time (jittered or bridged when asked for)."""
    training = shop.config.training
    if training.bridge_fraction > 0 and rng.random() < training.bridge_fraction:
        return _draw_bridge(rng, shop)
    index = int(shop.sequence.train_index[rng.integers(len(shop.sequence.train_index))])
    t = float(shop.sequence.times[index])
    jitter = training.time_jitter
    return index, t + jitter * rng.uniform(-0.5, 0.5) / shop.sequence.count if jitter > 0 else t


def _next_time(rng: np.random.Generator, shop: Workshop) -> float:
    """Time of the next iteration, from a copy of the generator; density control would draw from it first."""
    return _draw_view(copy.deepcopy(rng), shop)[1]


def _draw_bridge(rng: np.random.Generator, shop: Workshop) -> tuple[int, float]:
    """A time uniform between the first and the last training frame, and one of its two training neighbours.

    The neighbour is drawn with the weight that linear interpolation would give it, so that the expected target at
    every time is the blend of its neighbours: what lies between two frames is no longer free.
    """
    index = shop.sequence.train_index
    times = shop.sequence.times[index]
    t = float(rng.uniform(times[0], times[-1]))
    right = min(max(int(np.searchsorted(times, t, side="right")), 1), len(times) - 1)
    nearness = (t - times[right - 1]) / (times[right] - times[right - 1])
    return int(index[right if rng.random() < nearness else right - 1]), t


def _weights(state: TrainingState, iteration: int, config: Config) -> LossWeights:
    share = laplacian_ramp(iteration, config)
    smoothness = config.loss.smoothness_weight if smoothness_active(iteration, config) else 0.0
    full = state.lambda_lap or 0.0
    return LossWeights(config.loss.ssim_weight, config.loss.depth_weight, smoothness, share * full)


def _activate_residuals(state: TrainingState, config: Config) -> None:
    """The spectral residuals begin: zero coefficients, fresh moments, step 0."""
    model = config.model
    state.gaussians = activate_residuals(state.gaussians, model.frequencies, model.appearance, model.spectral_motion)
    for name in ("appearance_coefficients", "motion_coefficients"):
        array = getattr(state.gaussians, name)
        if array is not None:
            add_array(state.adam, name, array)


def _spectral_penalty(gaussians: Gaussians, shop: Workshop) -> float | None:
    """L_msp; None without component S."""
    coefficients = gaussians.motion_coefficients
    return None if coefficients is None else matern_penalty_forward(coefficients, shop.spectral.rho)[0]


def _watch_density(state: TrainingState, grads: RenderGrads, camera: Camera, active: bool) -> None:
    """The statistics that density control goes by."""
    if active:
        gather_statistics(state.statistics, grads.mean2d, grads.visible, camera.width, camera.height)


def _control_density(state: TrainingState, shop: Workshop) -> None:
    """Clone, split and prune; statistics start anew."""
    density = shop.config.density
    result = densify(
        state.gaussians, state.adam, state.statistics, density, state.rng, shop.extent, consume_moments=True
    )
    state.gaussians, state.adam, state.statistics = result.gaussians, result.adam, result.statistics


def _log_entry(
    iteration: int,
    index: int,
    loss: ImageLoss,
    penalty: float | None,
    rendered: RenderOut,
    targets: Targets,
    state: TrainingState,
    config: Config,
) -> dict[str, Any]:
    """What the log keeps of an iteration. Raises FloatingPointError on a loss that is not finite."""
    total = float(loss.loss) + config.loss.lambda_msp * (penalty or 0.0)
    if not math.isfinite(total):
        raise FloatingPointError(f"iteration {iteration}, frame {index}: loss is {total}; terms {loss.terms}")
    terms = {name: float(value) for name, value in loss.terms.items()}
    entry: dict[str, Any] = {"iteration": iteration, "frame": index, "loss": total, **terms}
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


def bench_state(gaussians: Gaussians, config: Config, iteration: int) -> TrainingState:
    """A state at a given iteration for benchmarks and tests, with fresh moments."""
    weight = config.loss.lambda_lap
    return TrainingState(
        gaussians,
        adam_state(arrays(gaussians)),
        iteration,
        np.random.default_rng(config.training.seed),
        empty_statistics(gaussians.count),
        0.83 if weight == "auto" else float(weight),
    )
