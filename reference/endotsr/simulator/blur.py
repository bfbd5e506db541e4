"""Motion blur: the times of an exposure, over which a picture is integrated.

In: settings. Out: the time for which the shutter is open, and the times that are averaged.
"""

import numpy as np

from endotsr.kernels.arrays import FloatArray
from endotsr.simulator.settings import SimulatorSettings


def open_span(settings: SimulatorSettings) -> float:
    """Normalised time for which the shutter is open; 0 while the effect is off."""
    part = settings.motion_blur
    return part.shutter / settings.frames if part.on else 0.0


def shutter_times(settings: SimulatorSettings) -> FloatArray:
    """The averaged times: middles of equal parts of the open time, relative to the time of the frame."""
    samples = settings.motion_blur.samples
    return open_span(settings) * ((np.arange(samples) + 0.5) / samples - 0.5)
