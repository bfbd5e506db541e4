"""Parameters that are not per Gaussian: one value for each training frame.

The frame is the LAST axis of every array, as the Gaussian is in `Gaussians`. Density control never touches these
arrays; optimiser and checkpoint hold them by field name, beside those of the Gaussians. A parameter that is
switched off is None, and a model without any has no `FrameParameters` at all. (A parameter of the whole sequence
is a field without the frame axis.)

A new parameter needs a field here, a setting and a rate (`learning_rates`), and a forward and a reverse pass where it
acts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.config import ModelConfig
from endotsr.kernels.arrays import FloatArray

CHANNELS = 3


class Exposure(NamedTuple):
    """Exposure of one frame or of one moment, equation (B13)."""

    log_gain: FloatArray  # (3,) natural logarithm of the gain
    bias: FloatArray  # (3,) display units


class FrameParameters(NamedTuple):
    """Parameters of n training frames; held-out frames have none."""

    times: NDArray[np.float64]  # (n,) normalised times of the training frames, ascending; not trained
    exposure_log_gain: FloatArray | None = None  # (3, n) [channel, training frame]
    exposure_bias: FloatArray | None = None  # (3, n) display units


def frame_parameters(model: ModelConfig, train_times: FloatArray, dtype: DTypeLike) -> FrameParameters | None:
    """Parameters at the start of training: every exposure is the identity. None if the model has no such parameter.

    train_times  (n,) normalised times of the training frames, ascending
    """
    if not model.exposure:
        return None
    shape = (CHANNELS, len(train_times))
    return FrameParameters(np.array(train_times, np.float64), np.zeros(shape, dtype), np.zeros(shape, dtype))


def trained(frames: FrameParameters | None) -> dict[str, FloatArray]:
    """The arrays that are trained, by field name, in field order; none without `frames`."""
    named = {} if frames is None else frames._asdict()
    return {name: a for name, a in named.items() if name != "times" and a is not None}


def exposure_of(frames: FrameParameters | None, k: int) -> Exposure | None:
    """Exposure of training frame k (a position among the training frames), copied; None if the model has none."""
    if frames is None or frames.exposure_log_gain is None or frames.exposure_bias is None:
        return None
    return Exposure(frames.exposure_log_gain[:, k].copy(), frames.exposure_bias[:, k].copy())


def exposure_at(frames: FrameParameters | None, t: float) -> Exposure | None:
    """Exposure at any time: linear in t between the two neighbouring training frames, constant beyond the ends.

    At the time of a training frame this is the exposure of that frame. None if the model has none.
    """
    if frames is None or frames.exposure_log_gain is None or frames.exposure_bias is None:
        return None
    rows = [np.array([np.interp(t, frames.times, row) for row in array], array.dtype)
            for array in (frames.exposure_log_gain, frames.exposure_bias)]  # fmt: skip
    return Exposure(*rows)


def column_gradients(frames: FrameParameters, k: int, exposure: Exposure) -> dict[str, FloatArray]:
    """Gradients by the trained arrays from those by the exposure of frame k: zero in every other column."""
    gradients = {name: np.zeros_like(array) for name, array in trained(frames).items()}
    gradients["exposure_log_gain"][:, k] = exposure.log_gain
    gradients["exposure_bias"][:, k] = exposure.bias
    return gradients
