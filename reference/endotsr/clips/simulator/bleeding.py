"""Local bleeding: blood spreads from one spot of the tissue and moves with the tissue.

In: material coordinates and a time. Out: the reflectance of tissue and blood.
"""

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.method.kernels.arrays import FloatArray

BLOOD = np.array([0.20, 0.010, 0.009])  # linear reflectance
CENTRE = (-0.05, -0.02)  # of the spot, distances of the camera
EDGE = 0.5  # width of the soft edge, mm
LOBES = ((2, 0.14), (3, 0.12), (5, 0.07))  # waves of the outline: number around the spot, relative height


def with_blood(settings: SimulatorSettings, reflectance: FloatArray, material: FloatArray, t: float) -> FloatArray:
    """The reflectance (3, H, W) of tissue and blood at material coordinates (2, H, W)."""
    cover = blood_cover(settings, material, t)
    return reflectance * (1 - cover) + BLOOD.reshape(3, *[1] * cover.ndim) * cover


def blood_cover(settings: SimulatorSettings, material: FloatArray, t: float) -> FloatArray:
    """The fraction of the colour that blood replaces, (H, W): 0 before the bleeding begins.

    The area grows linearly in time. The seed determines the wavy outline.
    """
    part = settings.bleeding
    if t <= part.start:
        return np.zeros(material.shape[1:])
    da, db = material[0] - CENTRE[0] * settings.distance, material[1] - CENTRE[1] * settings.distance
    phases = np.random.default_rng([settings.seed, 4]).uniform(0, 2 * np.pi, len(LOBES))
    distance, size = np.hypot(da, db), part.radius * np.sqrt((t - part.start) / (1 - part.start))
    near = distance <= size * (1 + sum(height for _, height in LOBES))  # no blood beyond
    angle = np.arctan2(db[near], da[near])
    wave = sum(height * np.sin(lobes * angle + phase) for (lobes, height), phase in zip(LOBES, phases))
    inside = np.clip((size * (1 + wave) - distance[near]) / EDGE, 0.0, 1.0)
    cover = np.zeros(distance.shape)
    cover[near] = part.opacity * inside * inside * (3 - 2 * inside)
    return cover
