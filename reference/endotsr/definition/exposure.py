"""Equation (B13): the exposure of one frame, a gain and a bias of each colour channel."""

from collections import namedtuple

import numpy as np

EXPOSURES = ("exposure_log_gain", "exposure_bias")  # the trained arrays, (3, n) [channel, training frame]
ExposureSaved = namedtuple("ExposureSaved", "colour log_gain")
ExposureGrads = namedtuple("ExposureGrads", "d_colour d_log_gain d_bias")


def exposure_forward(colour, log_gain, bias):
    """Equation (B13): exposed colours (C, H, W) from `colour` (C, H, W), log_gain (C,) and bias (C,)."""
    exposed = np.exp(log_gain)[:, None, None] * colour + bias[:, None, None]
    return exposed, ExposureSaved(colour, log_gain)


def exposure_reverse(d_exposed, saved):
    """Reverse of (B13)."""
    colour, gain = saved.colour, np.exp(saved.log_gain)
    d_log_gain = gain * (d_exposed * colour).sum(axis=(1, 2))  # (11.12)
    return ExposureGrads(gain[:, None, None] * d_exposed, d_log_gain, d_exposed.sum(axis=(1, 2)))
