"""Cutting: a slit that a blade opens in the tissue, and the displacement of the tissue next to it.

x runs along the slit and y across it, in millimetres of the material (a, b). At time t the slit extends from one end to
the blade. Its half width at x is w(x, t) = h(t) (1 - s^2)^2, with s in [-1, 1] from end to blade. A material point
moves by

    +-w(x, t) exp(-y^2 / (2 reach^2)) across,    + for y >= 0,

which is discontinuous only at y = 0. The wound is a groove between the two edges, at x along + y across with |y| <= w.
Its points are new: they have no material coordinates.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray

CENTRE = (-0.08, -0.05)  # middle of the slit, distances of the camera
ANGLE = 0.6  # of its direction to the a axis, radians
STEEPEST = float(np.exp(-0.5))  # largest slope of exp(-y^2 / 2), at y = 1
LARGEST_STRETCH = 0.9  # compression of the tissue at y = reach; from 1 on it would fold over itself


class Slit(NamedTuple):
    """The slit at rest and its opening over time."""

    centre: FloatArray  # (2,) material coordinates, mm
    along: FloatArray  # (2,) unit vectors of the material plane
    across: FloatArray  # (2,)
    length: float  # mm
    half_opening: float  # largest half width, mm
    reach: float  # mm
    depth: float  # of the wound, mm
    start: float  # normalised time
    stop: float


def make_slit(settings: SimulatorSettings) -> Slit:
    """The slit of the settings. Raises InputError if the tissue next to it would fold, or for stop <= start."""
    part = settings.cutting
    widest = 2 * LARGEST_STRETCH * part.reach / STEEPEST
    if part.opening > widest:
        raise InputError(
            f"simulator: cutting.opening = {part.opening:g} folds the tissue next to the slit; use at most"
            f" {widest:.3g} with cutting.reach = {part.reach:g}"
        )
    if part.start >= part.stop:
        raise InputError(f"simulator: cutting.stop = {part.stop:g}: use a number above cutting.start = {part.start:g}")
    centre = np.array(CENTRE) * settings.distance
    along = np.array([np.cos(ANGLE), np.sin(ANGLE)])
    across = np.array([-along[1], along[0]])
    return Slit(centre, along, across, part.length, 0.5 * part.opening, part.reach, part.depth, part.start, part.stop)


def is_open(slit: Slit, t: float) -> bool:
    """Whether the blade has started."""
    return t > slit.start


def slit_coordinates(slit: Slit, a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x along and y across the slit of material points, mm."""
    da, db = a - slit.centre[0], b - slit.centre[1]
    return da * slit.along[0] + db * slit.along[1], da * slit.across[0] + db * slit.across[1]


def side_of(slit: Slit, a: FloatArray, b: FloatArray) -> FloatArray:
    """The side of material points, +1 or -1. Points on the line count as +1."""
    return np.where(slit_coordinates(slit, a, b)[1] >= 0, 1.0, -1.0)


def half_width(slit: Slit, x: FloatArray, t: float) -> tuple[FloatArray, FloatArray]:
    """Half the width of the slit at x, mm, and its derivative. Both are 0 for a closed slit and beyond its ends.

    The blade moves at constant speed. The width is proportional to the smooth step 3 p^2 - 2 p^3 of its progress p.
    """
    progress = min(max((t - slit.start) / (slit.stop - slit.start), 0.0), 1.0)
    if progress == 0.0:
        return np.zeros_like(x), np.zeros_like(x)
    half_length = 0.5 * slit.length * progress
    s = np.clip((x + 0.5 * slit.length - half_length) / half_length, -1.0, 1.0)
    size = slit.half_opening * progress * progress * (3 - 2 * progress)
    return size * (1 - s**2) ** 2, -4 * size / half_length * s * (1 - s**2)


def parting(
    slit: Slit, a: FloatArray, b: FloatArray, side: FloatArray | None, t: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Displacement across the slit, mm, and its derivatives with respect to a and b.

    side     +1 or -1; None selects the side of each point. For points beyond the line, a given side continues its own
             formula smoothly.
    """
    x, y = slit_coordinates(slit, a, b)
    side = np.where(y >= 0, 1.0, -1.0) if side is None else side
    width, slope = half_width(slit, x, t)
    fall = side * np.exp(-(y**2) / (2 * slit.reach**2))
    by_x, by_y = slope * fall, -y / slit.reach**2 * width * fall
    return (
        width * fall,
        by_x * slit.along[0] + by_y * slit.across[0],
        by_x * slit.along[1] + by_y * slit.across[1],
    )
