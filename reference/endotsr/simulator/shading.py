"""From geometry and reflectance to linear light: a point light at the camera, fall-off with distance, highlights.

In: a `View` of the sheet, its texture, the camera, the time. Out: linear RGB, which `to_display` encodes for display.
"""

import numpy as np

from endotsr.kernels.arrays import FloatArray
from endotsr.simulator.settings import SimulatorSettings
from endotsr.simulator.surface import View, gaussian_weight
from endotsr.simulator.texture import Texture, sample
from endotsr.splatting.camera import Camera, camera_centre

GAIN = 0.95  # linear light of a reflectance of 1, perpendicular to the view, at the scene's distance
WRAP = 0.15  # light scattered inside the tissue softens the shading
BEAM = 3.0  # exponent of the lamp's fall-off towards the edge of its cone
GAMMA = 2.2


def shade(settings: SimulatorSettings, texture: Texture, view: View, camera: Camera, t: float) -> FloatArray:
    """Linear light (3, H, W) from the tissue, before exposure.

    reflectance * (n.l + wrap)/(1 + wrap) * (distance / r)^2 * beam, plus a highlight (n'.l)^exponent with the same
    fall-off, where l points to the lamp at the camera, r is its distance and n' is the normal of the fine relief.
    """
    maps = sample(texture, view.material)
    towards = camera_centre(camera)[:, None, None] - view.point
    r = np.sqrt((towards**2).sum(axis=0))
    towards /= r
    cosine = (view.normal * towards).sum(axis=0)
    axis = view.depth / r  # cosine of the angle to the optical axis
    received = GAIN * (settings.distance / r) ** 2 * axis**BEAM
    light = maps[:3] * (received * np.maximum(cosine + WRAP, 0.0) / (1 + WRAP))
    if settings.brightening.on:
        light = light * _brightening(settings, view.material, t)
    if settings.highlights.on:
        bent = view.normal.copy()
        bent[0] += maps[3]
        bent[1] += maps[4]
        bent /= np.sqrt((bent**2).sum(axis=0))
        mirror = np.maximum((bent * towards).sum(axis=0), 0.0) ** settings.highlights.exponent
        light = light + settings.highlights.strength * received * mirror
    return light


def exposure_gain(settings: SimulatorSettings, t: float) -> FloatArray:
    """Gain of the three channels at time t, (3,); exactly 1 while the effect is off."""
    part = settings.exposure
    if not part.on:
        return np.ones(3)
    angle = 2 * np.pi * part.cycles * t
    return 1 + part.amplitude * np.array(
        [np.sin(angle), 0.85 * np.sin(angle), 0.85 * np.sin(angle) + 0.3 * np.sin(angle / 2)]
    )


def to_display(light: FloatArray) -> FloatArray:
    """Linear light to display values in [0, 1]: clipped at 1, then raised to the power 1/2.2."""
    return np.clip(light, 0.0, 1.0) ** (1 / GAMMA)


def _brightening(settings: SimulatorSettings, material: FloatArray, t: float) -> FloatArray:
    part = settings.brightening
    centre = (-0.14 * settings.distance, -0.12 * settings.distance)
    weight = gaussian_weight(centre, part.width)(material[0], material[1])[0]
    return 1 + part.amplitude * np.sin(np.pi * part.cycles * t) ** 2 * weight
