"""The coarse start of a training (specification B17): half-size frames until the fit error is below the missing detail.

    e(i) = mean_k L1(render of frame k at half size)         d = mean_k mean |P_1(frame k)|  over its valid pixels

P_1 is the finest band of equation (5), the detail missing from half-size frames. Training switches to the full frames
after the first check with e(i) < d, at the latest at `density.until`. In: a state and the sequence. Out: whether the
next iteration uses the full frames. This module changes no parameter.
"""

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.smaller import halved
from endotsr.config import Config
from endotsr.method.equations.calibration import calibration_views
from endotsr.method.equations.laplacian import laplacian_levels, support_masks
from endotsr.method.losses.masked_l1 import masked_l1_forward
from endotsr.training.fitting.model import camera_at, render_at
from endotsr.training.fitting.state import TrainingConstants, TrainingState, training_constants

CHECK_EVERY = 50  # iterations between two checks
CHECKED_FRAMES = 8  # evenly spaced training frames rendered by a check


class CoarseStart(NamedTuple):
    """Constants of a coarse start."""

    constants: TrainingConstants  # of the half-size frames
    frames: NDArray[np.intp]  # rendered by a check; those with tissue
    lacking: float  # d, display units


def coarse_start(sequence: Sequence, config: Config) -> CoarseStart:
    """The coarse start of a training on a sequence."""
    frames = sequence.train_index[calibration_views(len(sequence.train_index), CHECKED_FRAMES)]
    small = training_constants(halved(sequence, config.sequence.memory), coarse_config(config))
    seen = frames[small.sequence.masks[frames].any(axis=(1, 2))]  # without tissue, any render would fit a frame
    return CoarseStart(small, seen if seen.size else frames, lacking(sequence, frames))


def coarse_config(config: Config) -> Config:
    """The settings for half the size: half the smoothness keeps the total variation of a slope, not its squares."""
    loss = msgspec.structs.replace(config.loss, smoothness_weight=config.loss.smoothness_weight / 2)  # (20.7)
    return msgspec.structs.replace(config, loss=loss)


def coarse_ends(state: TrainingState, coarse: CoarseStart) -> bool:
    """Whether the coarse start ends before the next iteration; a check also sets `state.coarse_until`."""
    if state.iteration >= coarse.constants.config.density.until:
        return True
    if state.iteration == 0 or state.iteration % CHECK_EVERY:
        return False
    error = fit_error(state, coarse.constants, coarse.frames)
    found = expected_end(state.iteration, error, coarse)
    state.coarse_until = (state.coarse_until + found) // 2 if state.coarse_until else found  # one check is a sample
    return error < coarse.lacking  # (20.5)


def expected_end(iteration: int, error: float, coarse: CoarseStart) -> int:
    """The iteration at which the fit error will have fallen to d, as a forecast of time needs it.

    A rule of thumb: the error is taken to fall with the root of the iterations.
    """
    latest = coarse.constants.config.density.until
    ratio = error / coarse.lacking if coarse.lacking > 0 else np.inf
    return int(min(iteration * max(ratio, 1.0) ** 2, latest))


def fit_error(state: TrainingState, constants: TrainingConstants, frames: NDArray[np.intp]) -> float:
    """e: the mean masked L1 (B6) of the renders of some frames, display units."""
    errors = []
    for index in map(int, frames):
        frame = constants.sequence.frame(index, constants.config.training.precision)
        at = (camera_at(state.frames, frame.camera, frame.time), frame.time)
        rendered = render_at(state.gaussians, constants.spectral, constants.config, *at, frames=state.frames)
        errors.append(masked_l1_forward(rendered.colour, frame.image, frame.mask)[0])
    return float(np.mean(errors))


def lacking(sequence: Sequence, frames: NDArray[np.intp]) -> float:
    """d: the mean magnitude of the finest Laplacian band of some frames over its valid pixels, display units.

    Edges: a frame without a valid pixel is excluded; 0 if none has one, and the coarse start then ends at the latest
           iteration.
    """
    found = []
    for index in map(int, frames):
        frame = sequence.frame(index)
        valid = support_masks(frame.mask, 1).bands[0]
        if valid.any():
            found.append(np.abs(laplacian_levels(frame.image, 1).bands[0][:, valid]).mean(dtype=np.float64))  # (20.4)
    return float(np.mean(found)) if found else 0.0
