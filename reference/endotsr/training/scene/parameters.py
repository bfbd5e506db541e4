"""Parameters with one value per training frame instead of one per Gaussian.

The frame is the LAST axis of every array, as the Gaussian is in `Gaussians`. Density control never changes these
arrays; optimiser and checkpoint store them by field name, together with the arrays of the Gaussians. A disabled
parameter is None; a model without any has no `FrameParameters`. (A parameter of the whole sequence would be a field
without the frame axis.)

A new parameter needs a field here, a setting, a learning rate (`learning_rates`), and its forward and reverse pass.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.config import ModelConfig
from endotsr.method.kernels.arrays import FloatArray

CHANNELS = 3  # colour channels; rotation vectors and translations have 3 entries too


class Exposure(NamedTuple):
    """Exposure of one frame or at one time, equation (B13)."""

    log_gain: FloatArray  # (3,) natural logarithm of the gain
    bias: FloatArray  # (3,) display units


class Pose(NamedTuple):
    """Correction of the camera pose of one frame or at one time, equation (B16)."""

    rotation: FloatArray  # (3,) rotation vector, rad, camera axes
    translation: FloatArray  # (3,) scene units, camera axes


class FrameParameters(NamedTuple):
    """Parameters of n training frames; held-out frames have none."""

    times: NDArray[np.float64]  # (n,) normalised times of the training frames, ascending; not trained
    exposure_log_gain: FloatArray | None = None  # (3, n) [channel, training frame]
    exposure_bias: FloatArray | None = None  # (3, n) display units
    pose_rotation: FloatArray | None = None  # (3, n) rotation vectors, rad
    pose_translation: FloatArray | None = None  # (3, n) scene units


def frame_parameters(model: ModelConfig, train_times: FloatArray, dtype: DTypeLike) -> FrameParameters | None:
    """Parameters at the start of training, all the identity. None if the model has no such parameter.

    train_times  (n,) normalised times of the training frames, ascending
    """
    found = FrameParameters(np.array(train_times, np.float64))
    shape = (CHANNELS, len(train_times))
    if model.exposure:
        found = found._replace(exposure_log_gain=np.zeros(shape, dtype), exposure_bias=np.zeros(shape, dtype))
    if model.pose_correction:
        found = found._replace(pose_rotation=np.zeros(shape, dtype), pose_translation=np.zeros(shape, dtype))
    return found if trained(found) else None


def trained(frames: FrameParameters | None) -> dict[str, FloatArray]:
    """The trained arrays by field name, in field order; empty without `frames`."""
    named = {} if frames is None else frames._asdict()
    return {name: a for name, a in named.items() if name != "times" and a is not None}


def exposure_of(frames: FrameParameters | None, k: int) -> Exposure | None:
    """A copy of the exposure of training frame k (position among the training frames); None if the model has none."""
    if frames is None or frames.exposure_log_gain is None or frames.exposure_bias is None:
        return None
    return Exposure(frames.exposure_log_gain[:, k].copy(), frames.exposure_bias[:, k].copy())


def exposure_at(frames: FrameParameters | None, t: float) -> Exposure | None:
    """Exposure at any time: linear in t between neighbouring training frames, constant beyond the ends.

    None if the model has none.
    """
    if frames is None or frames.exposure_log_gain is None or frames.exposure_bias is None:
        return None
    return Exposure(*(_at(frames, t, array) for array in (frames.exposure_log_gain, frames.exposure_bias)))


def pose_at(frames: FrameParameters | None, t: float) -> Pose | None:
    """Correction of the pose at any time: both vectors are interpolated as in `exposure_at`.

    None if the model has none.
    """
    if frames is None or frames.pose_rotation is None or frames.pose_translation is None:
        return None
    return Pose(*(_at(frames, t, array) for array in (frames.pose_rotation, frames.pose_translation)))


def _at(frames: FrameParameters, t: float, array: FloatArray) -> FloatArray:
    """A parameter (3, n) of frames at time t, (3,)."""
    return np.array([np.interp(t, frames.times, row) for row in array], array.dtype)


def exposure_gradients(frames: FrameParameters, k: int, exposure: Exposure) -> dict[str, FloatArray]:
    """Gradients of all exposures, from the gradients of frame k: zero in every other column."""
    return _in_columns(frames, "exposure", exposure, {k: 1.0})


def pose_gradients(frames: FrameParameters, t: float, pose: Pose) -> dict[str, FloatArray]:
    """Gradients of all poses, from the gradients of the correction at time t: the adjoint of `pose_at`."""
    last = frames.times.size - 1
    left = int(np.clip(np.searchsorted(frames.times, t, side="right") - 1, 0, last))
    right = min(left + 1, last)
    part = float(np.interp(t, frames.times[[left, right]], (0.0, 1.0))) if right > left else 0.0
    return _in_columns(frames, "pose", pose, {right: part, left: 1.0 - part})


def _in_columns(
    frames: FrameParameters, group: str, vectors: Exposure | Pose, weights: dict[int, float]
) -> dict[str, FloatArray]:
    """For every array (3, n) of a group, zeros with its vector (3,), weighted, in some columns."""
    found = {}
    for name, vector in vectors._asdict().items():
        array = found[f"{group}_{name}"] = np.zeros_like(getattr(frames, f"{group}_{name}"))
        for k, weight in weights.items():
            array[:, k] = weight * vector
    return found
