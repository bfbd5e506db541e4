"""Equation (B13): the exposure of one frame, a gain and a bias of each colour channel.

In: the rendered colours of a view and the parameters of its frame. Out: the colours that are compared with the
observed frame. Gain and bias are constant over the image: they model automatic exposure and white balance, not local
changes of light. This module depends on neither frame number nor time.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray


class ExposureSaved(NamedTuple):
    """The input colours by reference, and the gains."""

    colour: FloatArray  # (C, H, W)
    gain: FloatArray  # (C,) exp(log_gain), float64


class ExposureGrads(NamedTuple):
    """Derivatives with respect to the three inputs."""

    d_colour: FloatArray  # (C, H, W)
    d_log_gain: FloatArray  # (C,)
    d_bias: FloatArray  # (C,)


def exposure_forward(colour: FloatArray, log_gain: FloatArray, bias: FloatArray) -> tuple[FloatArray, ExposureSaved]:
    """Equation (B13): exposed[c, p] = exp(log_gain[c]) colour[c, p] + bias[c].

    colour    (C, H, W)  display units, not clamped
    log_gain  (C,)       natural logarithm of the gain, any number
    bias      (C,)       display units, any number
    returns   (C, H, W) exposed colours, display units, not clamped, dtype of `colour`; and the saved tuple

    Reverse: exposure_reverse, below.
    Edges:   log_gain = 0 and bias = 0 return equal colours; H W = 0 works.
    Raises:  ValueError unless each parameter has one number per channel.
    Oracle:  `endotsr.definition.exposure`
    """
    channels = colour.shape[0]
    if log_gain.shape != (channels,) or bias.shape != (channels,):
        raise ValueError(f"{channels} channels: got log_gain {log_gain.shape} and bias {bias.shape}")
    gain = np.exp(log_gain.astype(np.float64))
    exposed = colour * gain.astype(colour.dtype)[:, None, None]
    exposed += bias.astype(colour.dtype)[:, None, None]
    return exposed, ExposureSaved(colour, gain)


def exposure_reverse(d_exposed: FloatArray, saved: ExposureSaved) -> ExposureGrads:
    """Reverse of equation (B13). Sums over pixels are in float64, in a fixed order.

    d_exposed  (C, H, W)  derivative of the loss with respect to the exposed colours
    returns    d_colour = gain d_exposed, d_log_gain = gain sum_p d_exposed colour, d_bias = sum_p d_exposed
    """
    dtype = saved.colour.dtype
    d_colour = d_exposed * saved.gain.astype(dtype)[:, None, None]
    d_gain = np.multiply(d_exposed, saved.colour, dtype=np.float64).sum(axis=(1, 2))
    d_bias = d_exposed.sum(axis=(1, 2), dtype=np.float64)
    return ExposureGrads(d_colour, (saved.gain * d_gain).astype(dtype), d_bias.astype(dtype))
