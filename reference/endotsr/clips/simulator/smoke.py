"""Smoke between camera and tissue: drifting clouds that replace a fraction of the light with grey.

In: settings and a time. Out: the fraction of smoke in every pixel. The clouds are a smooth random field in units of the
image width: every image size of one aspect ratio shows the same smoke.
"""

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.surface import smooth_step
from endotsr.clips.simulator.texture import SPLINE_DEVIATION, spline_basis
from endotsr.method.kernels.arrays import FloatArray

GREY = np.array([0.50, 0.50, 0.53])  # linear light of dense smoke
CONTRAST = 1.5  # of the clouds, in standard deviations of the field
RISE, FALL = 0.25, 0.35  # fractions of its time during which the smoke rises and clears
TURNS = 2.0  # changes of shape during the sequence


def with_smoke(settings: SimulatorSettings, light: FloatArray, t: float) -> FloatArray:
    """The light (3, H, W) behind the smoke."""
    fraction = smoke_fraction(settings, t)
    return light * (1 - fraction) + GREY[:, None, None] * fraction


def smoke_fraction(settings: SimulatorSettings, t: float) -> FloatArray:
    """The fraction of the light replaced by smoke, (H, W), at most the density."""
    part = settings.smoke
    if not part.start < t < part.stop:
        return np.zeros((settings.height, settings.width))
    phase = (t - part.start) / (part.stop - part.start)
    size = part.density * smooth_step(phase / RISE) * smooth_step((1 - phase) / FALL)
    angle = np.pi * TURNS * t
    field = np.cos(angle) * clouds(settings, t, 0) + np.sin(angle) * clouds(settings, t, 1)
    return size / (1 + np.exp(-CONTRAST * field))


def clouds(settings: SimulatorSettings, t: float, which: int) -> FloatArray:
    """A smooth random field (H, W) with standard deviation about 1, shifted by the drift to time t."""
    part = settings.smoke
    rng = np.random.default_rng([settings.seed, 6, which])
    way = abs(part.drift)
    x = (np.arange(settings.width) + 0.5) / settings.width - part.drift * t + max(part.drift, 0.0)
    y = (np.arange(settings.height) + 0.5) / settings.width
    over_x, over_y = (
        spline_basis(np.concatenate([[0.0], points, [end]]), part.size)[0][1:-1]
        for points, end in ((x, 1.0 + way), (y, settings.height / settings.width))
    )
    lattice = rng.standard_normal((over_x.shape[1], over_y.shape[1])).T / SPLINE_DEVIATION
    return over_y @ lattice @ over_x.T
