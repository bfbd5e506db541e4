"""Motion blur: the moments of an exposure, over which a picture is integrated.

In: settings. Out: the time for which the shutter is open, and the moments that are averaged.
"""

import numpy as np

from endotsr.kernels.arrays import FloatArray
from endotsr.simulator.settings import SimulatorSettings


def open_span(settings: SimulatorSettings) -> float:
    """Normalised time for which the shutter is open; 0 while the effect is off."""
    part = settings.motion_blur
    return part.shutter / settings.frames if part.on else 0.0


def moments(settings: SimulatorSettings) -> FloatArray:
    """The moments of an exposure: middles of equal parts of the open time, relative to the time of the frame."""
    samples = settings.motion_blur.samples
    return open_span(settings) * ((np.arange(samples) + 0.5) / samples - 0.5)
