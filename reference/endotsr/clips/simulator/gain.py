"""The camera gain over time: exposure drift, jumps of the automatic exposure, and their Fourier coefficients.

In: settings and times. Out: one factor per channel in linear light. `to_display` encodes linear light for display.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.method.kernels.arrays import FloatArray

GAMMA = 2.2
LEAST_JUMP = 0.5  # smallest size of a gain level, in units of the amplitude


class GainSpectrum(NamedTuple):
    """gain(t_i) = sum_k cosine[k] cos(2 pi k t_i) + sine[k] sin(2 pi k t_i), with t_i = i / n, for every channel."""

    cycles: FloatArray  # (K,)    k = 0 .. n // 2, cycles per sequence
    cosine: FloatArray  # (K, 3)  red, green, blue
    sine: FloatArray  # (K, 3)


def camera_gain(settings: SimulatorSettings, t: float) -> FloatArray | None:
    """Gain of the three channels at time t, (3,); None without an effect on it."""
    if not settings.auto_exposure.on:
        return exposure_gain(settings, t) if settings.exposure.on else None
    return exposure_gain(settings, t) * auto_exposure_gain(settings, t)


def exposure_gain(settings: SimulatorSettings, t: float) -> FloatArray:
    """Exposure drift: gain of the three channels at time t, (3,); exactly 1 without the effect."""
    part = settings.exposure
    if not part.on:
        return np.ones(3)
    angle = 2 * np.pi * part.cycles * t
    return 1 + part.amplitude * np.array(
        [np.sin(angle), 0.85 * np.sin(angle), 0.85 * np.sin(angle) + 0.3 * np.sin(angle / 2)]
    )


def auto_exposure_gain(settings: SimulatorSettings, t: float) -> float:
    """The gain between the jumps before and after t: 1 at first, then 1 +- amplitude x (0.5 .. 1), drawn from the seed.

    Jump j of m is at t = j / (m + 1).
    """
    part = settings.auto_exposure
    rng = np.random.default_rng([settings.seed, 5])
    size = rng.uniform(LEAST_JUMP, 1.0, part.steps)
    sign = np.where(np.arange(part.steps) % 2 == rng.integers(2), 1.0, -1.0)  # successive levels always differ
    done = min(int(np.floor(max(t, 0.0) * (part.steps + 1))), part.steps)
    return 1.0 if done == 0 else float(1 + part.amplitude * sign[done - 1] * size[done - 1])


def gain_series(settings: SimulatorSettings, times: FloatArray) -> FloatArray:
    """The gain at every time, (n, 3)."""
    gains = (camera_gain(settings, float(t)) for t in times)
    return np.stack([np.ones(3) if gain is None else gain for gain in gains])


def gain_spectrum(gain: FloatArray) -> GainSpectrum:
    """The Fourier coefficients of a gain series (n, 3) at t_i = i / n. Their sum equals the series to rounding."""
    n = len(gain)
    transform = np.fft.rfft(gain, axis=0) / n
    twice = np.full(len(transform), 2.0)
    twice[0] = 1.0
    if n % 2 == 0:
        twice[-1] = 1.0  # the Nyquist term has no conjugate
    return GainSpectrum(
        np.arange(len(transform)) + 0.0, twice[:, None] * transform.real, -twice[:, None] * transform.imag
    )


def to_display(light: FloatArray) -> FloatArray:
    """Linear light to display values in [0, 1]: clipped at 1, then raised to the power 1/2.2."""
    return np.clip(light, 0.0, 1.0) ** (1 / GAMMA)
