"""The state of a training, and its constants.

`TrainingState` has everything that changes between iterations. A checkpoint stores it without `ahead` and `drawn`,
which are recomputed, and without `making` and `coarse_until`, which forecasts alone read. Everything else (targets,
atoms, rates) is a function of the state, the sequence and the configuration; a resumed run is therefore bitwise equal
to an uninterrupted one. This module computes no gradient.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import msgspec
import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.method.kernels.memory import Kept, keep_freed_memory, memory_limit
from endotsr.method.losses.masked_ssim import stored_target
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import check_finite
from endotsr.training.fitting.adam import AdamState, Rate, adam_state
from endotsr.training.fitting.bridged import BridgedTargets
from endotsr.training.fitting.checkpoint import Checkpoint, restore_rng, save_checkpoint
from endotsr.training.fitting.model import OffsetsAhead, Spectral, spectral_from
from endotsr.training.fitting.objective import Targets, joined_targets, optional_depth_target
from endotsr.training.fitting.packed import PackedMask, packed_supports, unpacked_supports
from endotsr.training.fitting.records import NOTHING_MADE, CheckpointHeader, Making, RngState
from endotsr.training.fitting.sampling import Drawn, View
from endotsr.training.scene.density_control import DensityStatistics, empty_statistics, scene_extent
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.initialisation import initialise
from endotsr.training.scene.parameters import FrameParameters, frame_parameters, trained
from endotsr.untrusted.json import number

LEAST_COARSE_SIDE = 32  # pixels of a full frame; a smaller one has no coarse start


@dataclass
class TrainingState:
    """Everything that changes between iterations."""

    gaussians: Gaussians
    adam: AdamState  # moments of the Gaussians' arrays and of the trained arrays of `frames`
    iteration: int  # completed iterations
    rng: np.random.Generator
    statistics: DensityStatistics
    lambda_lap: float | None  # full Laplacian weight; None until an `auto` weight is calibrated
    frames: FrameParameters | None = None  # frame parameters; None if the model has none
    ahead: OffsetsAhead | None = None  # computed with the update of the FDM; not part of a checkpoint
    coarse: bool = False  # the next iteration is compared with frames of half size
    coarse_until: int = 0  # the expected last iteration of that; 0 = unknown; not stored
    drawn: Drawn | None = None  # the next view, drawn for `ahead`; a checkpoint stores the generator before the draw
    making: Making = NOTHING_MADE  # the work on targets at this size of the frames; not part of a checkpoint

    @property
    def rng_state(self) -> RngState:
        """The state of the generator before the draw of the next view."""
        return cast(RngState, dict(self.rng.bit_generator.state)) if self.drawn is None else self.drawn.rng_state


@dataclass
class TrainingConstants:
    """Constants of a training: functions of the sequence and the configuration."""

    sequence: Sequence
    config: Config
    spectral: Spectral
    extent: float
    supports: Kept[int, tuple[PackedMask, ...]]  # of the pyramid, by frame, cached at first use
    bridged: BridgedTargets  # between the frames, cached at first use
    depth: float = 1.0  # median depth of the tissue, scene units; computed only if poses are corrected

    def observed(self, view: View) -> tuple[Targets, Camera]:
        """The targets of a view, and its camera."""
        if view.bridged is not None:
            return self.bridged.observed(view.bridged)
        return self.targets_of(view.index), self.sequence.cameras[view.index]

    def column(self, view: View) -> int:
        """The position of the compared frame among the training frames."""
        return int(np.searchsorted(self.sequence.train_index, view.index))

    def in_scene_units(self, rates: dict[str, Rate]) -> dict[str, Rate]:
        """The rates of `learning_rates`, with the rate of pose translations in scene units."""
        given = rates.get("pose_translation")
        return rates if given is None else rates | {"pose_translation": cast(float, given) * self.depth}

    def targets_of(self, index: int) -> Targets:
        """The targets of a frame: cached supports of the pyramid; image and depth, computed at every visit."""
        sequence, config, precision = self.sequence, self.config, self.config.training.precision
        mask, rule, supports = sequence.masks[index], config.loss.upsampling, None
        depth = optional_depth_target(sequence.depth[index].astype(precision, copy=False), mask, config)
        if config.model.laplacian:
            supports = unpacked_supports(self.supports.get(index, lambda: packed_supports(mask, rule)), mask, rule)
        return joined_targets(stored_target(sequence.images[index], 255, mask, precision), depth, supports, config)


def training_constants(sequence: Sequence, config: Config) -> TrainingConstants:
    """Spectral constants and scene extent of a sequence.

    The pyramid supports of the frames, and the targets between them, may each use 25 % of `sequence.memory`.
    """
    keep_freed_memory()
    limit = memory_limit(config.sequence.memory) / 4
    spectral = spectral_from(config.model, sequence.times[sequence.train_index])
    extent = scene_extent(config.density, [sequence.cameras[i] for i in sequence.train_index])
    bridged = BridgedTargets(sequence, config, Kept(limit))
    depth = _depth_of_tissue(sequence) if config.model.pose_correction else 1.0
    return TrainingConstants(sequence, config, spectral, extent, Kept(limit), bridged, depth)


def _depth_of_tissue(sequence: Sequence) -> float:
    """Median over the training frames of their median depth; 1 without any depth."""
    medians = [m for i in sequence.train_index if (m := sequence.tissue_depth(int(i))) is not None]
    return float(np.median(medians)) if medians else 1.0


def new_training(sequence: Sequence, config: Config) -> TrainingState:
    """Initialise from the training frames, seeded.

    Raises: InputError if the frames have no usable pixel, or if pose correction is on and the camera does not move.
    """
    if config.model.pose_correction and sequence.static_camera:
        raise InputError(
            "model.pose_correction = true: the camera of this sequence does not move, so a correction would absorb"
            " tissue motion; use a sequence with a pose for each frame"
        )
    rng, dtype = np.random.default_rng(config.training.seed), np.dtype(config.training.precision)
    gaussians = initialise(sequence, config.initialisation, config.model, rng, dtype)
    frames = frame_parameters(config.model, sequence.times[sequence.train_index], dtype)
    state = fresh_state(gaussians, frames, rng, lambda_lap=_given_weight(config))
    state.coarse = config.training.coarse_start and min(sequence.width, sequence.height) >= LEAST_COARSE_SIDE
    return state


def bench_state(gaussians: Gaussians, config: Config, iteration: int) -> TrainingState:
    """A state at a given iteration for benchmarks and tests, with fresh moments and no frame parameters."""
    weight = _given_weight(config)
    rng = np.random.default_rng(config.training.seed)
    return fresh_state(gaussians, None, rng, iteration=iteration, lambda_lap=0.83 if weight is None else weight)


def fresh_state(
    gaussians: Gaussians,
    frames: FrameParameters | None,
    rng: np.random.Generator,
    *,
    iteration: int = 0,
    lambda_lap: float | None,
) -> TrainingState:
    """A state of given parameters, with zero moments and empty statistics."""
    adam = adam_state(arrays(gaussians) | trained(frames))
    return TrainingState(gaussians, adam, iteration, rng, empty_statistics(gaussians.count), lambda_lap, frames)


def _given_weight(config: Config) -> float | None:
    """lambda_lap of the settings; None if it must be calibrated."""
    weight = config.loss.lambda_lap
    return None if weight == "auto" else float(weight)


def check_state(state: TrainingState) -> None:
    """Raise ValueError with array and index if a parameter is not finite."""
    check_finite(arrays(state.gaussians))
    check_finite(trained(state.frames))


def save_state(path: Path, state: TrainingState, config: Config, sequence: str | None = None) -> None:
    """Write a checkpoint, atomically.

    sequence   fingerprint of the sequence of this checkpoint

    Raises: OSError, or FloatingPointError with array and index if a parameter is not finite (a render would merely
            omit its Gaussian). The previous checkpoint is then intact.
    """
    try:
        check_state(state)
    except ValueError as error:
        raise FloatingPointError(f"iteration {state.iteration}: {error}; the last checkpoint is kept") from None
    header: CheckpointHeader = {
        "config": msgspec.to_builtins(config), "lambda_lap": state.lambda_lap, "sequence": sequence,
        "coarse": state.coarse,
    }  # fmt: skip
    save_checkpoint(
        path, state.gaussians, state.adam, state.iteration, state.rng_state, state.statistics, header, state.frames
    )


def state_from_checkpoint(checkpoint: Checkpoint, config: Config) -> TrainingState:
    """The saved state. Raises InputError for a weight or a random state that no training has."""
    weight = checkpoint.header.get("lambda_lap")
    if weight is not None:
        number(weight, "header.lambda_lap", low=0.0)
    return TrainingState(
        checkpoint.gaussians,
        checkpoint.adam,
        checkpoint.iteration,
        restore_rng(checkpoint.rng_state),
        checkpoint.statistics,
        _given_weight(config) if weight is None else weight,
        checkpoint.frames,
        coarse=bool(checkpoint.header.get("coarse", False)),
    )
