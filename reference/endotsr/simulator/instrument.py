"""A grasper between camera and tissue, drawn in the image plane: shaft, wrist and two jaws.

In: settings, image size, time. Out: its linear light, its coverage and the pixels that the mask excludes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.arrays import FloatArray
from endotsr.simulator.settings import SimulatorSettings

ENTRY = np.array([1.12, 0.78])  # where the shaft leaves the picture, image widths
HOME = np.array([0.70, 0.52])  # middle of the path of the wrist
SHAFT, WRIST, JAW = 0.042, 0.036, 0.017  # half widths, image widths
JAW_LENGTH = 0.105
METAL = np.array([0.42, 0.43, 0.45])  # linear light
SLEEVE = np.array([0.045, 0.045, 0.05])


class Drawing(NamedTuple):
    """The instrument in one frame."""

    light: FloatArray  # (3, H, W) linear RGB
    coverage: FloatArray  # (H, W)    0 .. 1, smooth over one pixel at the outline
    excluded: NDArray[np.bool_]  # (H, W) instrument and margin


def draw(settings: SimulatorSettings, t: float) -> Drawing:
    """The instrument at time t."""
    part = settings.instrument
    angle = 2 * np.pi * part.cycles * t
    scale = np.array([1.0, settings.height / settings.width])
    wrist = HOME * [1.0, scale[1] / 0.8] + part.travel * np.array([np.cos(angle) - 1.0, 0.6 * np.sin(angle)])
    entry = ENTRY * [1.0, scale[1] / 0.8]
    along = (wrist - entry) / np.linalg.norm(wrist - entry)
    open_angle = 0.28 + 0.14 * np.cos(angle)
    x, y = np.meshgrid(
        (np.arange(settings.width) + 0.5) / settings.width, (np.arange(settings.height) + 0.5) / settings.width
    )
    grip = wrist + along * 0.05
    parts = [
        (_segment(x, y, entry, wrist - along * 0.07), SHAFT, SLEEVE),
        (_segment(x, y, wrist - along * 0.07, grip), WRIST, METAL),
        (_segment(x, y, grip, grip + JAW_LENGTH * _turned(along, open_angle)), JAW, METAL * 1.1),
        (_segment(x, y, grip, grip + JAW_LENGTH * _turned(along, -open_angle)), JAW, METAL * 0.9),
    ]
    pixel = 1.0 / settings.width
    light = np.zeros((3, settings.height, settings.width))
    coverage = np.zeros((settings.height, settings.width))
    outline = np.full_like(coverage, np.inf)
    for (distance, side), half_width, colour in parts:
        cover = np.clip(0.5 - (distance - half_width) / pixel, 0.0, 1.0)
        light = light * (1 - cover) + colour[:, None, None] * (_sheen(side / half_width) * cover)
        coverage = cover + coverage * (1 - cover)
        outline = np.minimum(outline, distance - half_width)
    # a partly covered pixel has the light of the instrument alone; the coverage blends it with the tissue
    light = np.divide(light, coverage, out=np.zeros_like(light), where=coverage > 0)
    return Drawing(light, coverage, outline < part.margin + pixel)


def _segment(x: FloatArray, y: FloatArray, start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance of every pixel from a segment, and the signed distance from its line."""
    axis = end - start
    length = np.linalg.norm(axis)
    axis = axis / length
    dx, dy = x - start[0], y - start[1]
    along = np.clip(dx * axis[0] + dy * axis[1], 0.0, length)
    distance = np.hypot(dx - along * axis[0], dy - along * axis[1])
    return distance, dx * axis[1] - dy * axis[0]


def _sheen(side: FloatArray) -> FloatArray:
    """Brightness across a round, polished bar, side in [-1, 1]."""
    profile = np.sqrt(np.clip(1 - side**2, 0.0, 1.0))
    return 0.25 + 0.6 * profile + 1.2 * np.exp(-(((side - 0.25) / 0.16) ** 2))


def _turned(vector: FloatArray, angle: float) -> FloatArray:
    return np.array(
        [np.cos(angle) * vector[0] - np.sin(angle) * vector[1], np.sin(angle) * vector[0] + np.cos(angle) * vector[1]]
    )
