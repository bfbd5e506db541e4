"""The tissue sheet as a formula for the position of every material point over time.

A material point has two coordinates (a, b) in millimetres. Its position at time t is

    X(a, b, t) = (a, b, distance + h(a, b)) + sum_k s_k(t) w_k(a, b) v_k

with waves h, and for every motion k a time course s_k (0 at t = 0), a spatial weight w_k and a direction v_k. A slit
adds the parting of its two sides (slit.py). World axes are the axes of the camera at rest: x right, y down, z forward.
X and its derivatives with respect to a and b are closed formulas: the geometry is exact to rounding.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.slit import Slit, is_open, make_slit, parting
from endotsr.method.kernels.arrays import FloatArray

Weight = Callable[
    [FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]
]  # (a, b) -> weight, its derivatives with respect to a and b

PULSATION_CENTRE = (-0.2, 0.1)  # centres of the beating and the pulled region, in camera distances
PULL_CENTRE = (0.06, 0.04)


class Motion(NamedTuple):
    """One term s(t) w(a, b) v."""

    course: Callable[[float], float]  # t -> mm, 0 at t = 0
    weight: Weight  # dimensionless
    direction: FloatArray  # (3,)


class Surface(NamedTuple):
    """The sheet: a sum of plane waves at rest, and its motions."""

    distance: float  # mm
    amplitude: FloatArray  # (M,) mm
    wave: FloatArray  # (2, M) radians per mm
    phase: FloatArray  # (M,)
    motions: list[Motion]
    slit: Slit | None = None


def make_surface(settings: SimulatorSettings) -> Surface:
    """The sheet and the active motions. Only the folds depend on the seed."""
    rng = np.random.default_rng([settings.seed, 0])
    wavelength = np.array([42.0, 31.0, 22.0, 15.0, 11.0])  # mm
    height = np.array([2.6, 1.4, 0.7, 0.25, 0.12])  # mm; the slopes add up to 1.05 at most
    angle = rng.uniform(0, 2 * np.pi, 5)
    wave = 2 * np.pi / wavelength * np.stack([np.cos(angle), np.sin(angle)])
    motions = []
    if settings.breathing.on:
        motions.append(_breathing(settings))
    if settings.pulsation.on:
        motions.append(_pulsation(settings))
    if settings.pull.on:
        motions.append(_pull(settings))
    slit = make_slit(settings) if settings.cutting.on else None
    return Surface(settings.distance, settings.relief * height, wave, rng.uniform(0, 2 * np.pi, 5), motions, slit)


def surface_point(surface: Surface, material: FloatArray, t: float) -> FloatArray:
    """World position of material points at normalised time t. (2, ...) mm to (3, ...) mm."""
    return evaluate(surface, material[0], material[1], t)[0]


def evaluate(
    surface: Surface, a: FloatArray, b: FloatArray, t: float, side: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and its derivatives with respect to a and b, each (3, ...); `side` as in `slit.parting`."""
    point = np.stack([a, b, np.full_like(a, surface.distance)])
    along_a, along_b = np.zeros_like(point), np.zeros_like(point)
    along_a[0], along_b[1] = 1.0, 1.0
    for amplitude, (ka, kb), phase in zip(surface.amplitude, surface.wave.T, surface.phase):
        argument = ka * a + kb * b + phase
        slope = amplitude * np.cos(argument)
        point[2] += amplitude * np.sin(argument)
        along_a[2] += ka * slope
        along_b[2] += kb * slope
    for motion in surface.motions:
        size = motion.course(t)
        if size == 0.0:
            continue
        weight, weight_a, weight_b = motion.weight(a, b)
        for axis in range(3):
            point[axis] += size * motion.direction[axis] * weight
            along_a[axis] += size * motion.direction[axis] * weight_a
            along_b[axis] += size * motion.direction[axis] * weight_b
    if surface.slit is not None and is_open(surface.slit, t):
        aside, aside_a, aside_b = parting(surface.slit, a, b, side, t)
        for axis in range(2):
            point[axis] += surface.slit.across[axis] * aside
            along_a[axis] += surface.slit.across[axis] * aside_a
            along_b[axis] += surface.slit.across[axis] * aside_b
    return point, along_a, along_b


def gaussian_weight(centre: tuple[float, float], width: float) -> Weight:
    """exp(-r^2 / (2 width^2)) around a material point, with its derivatives."""

    def weight(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        da, db = a - centre[0], b - centre[1]
        value = np.exp(-(da**2 + db**2) / (2 * width**2))
        return value, -da / width**2 * value, -db / width**2 * value

    return weight


def _breathing(settings: SimulatorSettings) -> Motion:
    wave_a, wave_b = 2 * np.pi / 120.0, 2 * np.pi / 90.0  # the lift varies slowly across the tissue

    def weight(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        argument = wave_a * a + wave_b * b
        slope = 0.3 * np.cos(argument)
        return 0.7 + 0.3 * np.sin(argument), wave_a * slope, wave_b * slope

    part = settings.breathing
    direction = np.array([0.25, -0.55, -0.8])
    course = lambda t: part.amplitude * np.sin(np.pi * part.cycles * t) ** 2
    return Motion(course, weight, direction / np.linalg.norm(direction))


def _pulsation(settings: SimulatorSettings) -> Motion:
    part = settings.pulsation
    centre = (PULSATION_CENTRE[0] * settings.distance, PULSATION_CENTRE[1] * settings.distance)
    direction = np.array([0.5, 0.2, -0.84])
    course = lambda t: (
        part.amplitude * (np.sin(2 * np.pi * part.cycles * t) + 0.4 * np.sin(4 * np.pi * part.cycles * t))
    )
    return Motion(course, gaussian_weight(centre, part.width), direction / np.linalg.norm(direction))


def _pull(settings: SimulatorSettings) -> Motion:
    part = settings.pull
    centre = (PULL_CENTRE[0] * settings.distance, PULL_CENTRE[1] * settings.distance)
    direction = np.array([0.75, 0.3, -0.59])

    def course(t: float) -> float:
        if not part.start < t < part.stop:
            return 0.0
        phase = (t - part.start) / (part.stop - part.start)
        return part.amplitude * smooth_step(phase / 0.4) * smooth_step((1 - phase) / 0.25)

    return Motion(course, gaussian_weight(centre, part.width), direction / np.linalg.norm(direction))


def smooth_step(x: float) -> float:
    """3 x^2 - 2 x^3 between 0 and 1, and constant beyond."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3 - 2 * x)
