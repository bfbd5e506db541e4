"""The lens: the picture darkens towards its corners."""

import numpy as np

from endotsr.kernels.arrays import FloatArray
from endotsr.simulator.settings import SimulatorSettings


def vignette(settings: SimulatorSettings) -> FloatArray:
    """The factor on the light of every pixel, (H, W): 1 - amplitude (r / r_corner)^2, r from the image centre."""
    x = (np.arange(settings.width) + 0.5) / settings.width - 0.5
    y = ((np.arange(settings.height) + 0.5) / settings.height - 0.5) * settings.height / settings.width
    corner = 0.25 * (1 + (settings.height / settings.width) ** 2)
    return 1 - settings.vignetting.amplitude * (x**2 + y[:, None] ** 2) / corner
