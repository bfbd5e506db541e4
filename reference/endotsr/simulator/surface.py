"""The tissue sheet as a formula: the position of every material point over time, and its view from a camera.

A material point has two coordinates (a, b) in millimetres. At rest it lies at (a, b, distance + h(a, b)); at time t at

    X(a, b, t) = (a, b, distance + h(a, b)) + sum_k s_k(t) w_k(a, b) v_k

with a wave h, and for every motion k a time course s_k (0 at t = 0), a spatial weight w_k and a direction v_k. World
axes are those of the resting camera: x right, y down, z forward. Because X and its derivatives by a and b are
formulas, the geometry is known to rounding.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.kernels.arrays import FloatArray
from endotsr.simulator.settings import SimulatorSettings
from endotsr.splatting.camera import Camera

Weight = Callable[
    [FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]
]  # (a, b) -> weight, its derivatives by a and b

RESIDUAL_TOLERANCE = 1e-10  # mm, beside the ray
MOST_STEPS = 30
BLOCK_PIXELS = 16384


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


class View(NamedTuple):
    """The part of the sheet that a camera sees, per pixel."""

    material: FloatArray  # (2, H, W) material coordinates a, b, mm
    point: FloatArray  # (3, H, W) world position, mm
    normal: FloatArray  # (3, H, W) unit normal, towards the camera
    depth: FloatArray  # (H, W) view-space z, mm


def make_surface(settings: SimulatorSettings) -> Surface:
    """The sheet and the motions that are switched on. The folds depend on the seed, the motions do not."""
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
    return Surface(settings.distance, settings.relief * height, wave, rng.uniform(0, 2 * np.pi, 5), motions)


def surface_point(surface: Surface, material: FloatArray, t: float) -> FloatArray:
    """World position of material points at normalised time t. (2, ...) mm to (3, ...) mm."""
    return _evaluate(surface, material[0], material[1], t)[0]


def _evaluate(surface: Surface, a: FloatArray, b: FloatArray, t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and its derivatives by a and by b, each (3, ...)."""
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
    return point, along_a, along_b


def see(surface: Surface, camera: Camera, t: float) -> View:
    """Intersect every pixel's ray with the sheet by Newton's method on the material coordinates.

    Solved is X_c - p_x Z_c = 0, Y_c - p_y Z_c = 0 in (a, b), with the camera position (X_c, Y_c, Z_c) of X(a, b, t) and
    the ray (p_x, p_y, 1) through the pixel centre. The start is the plane z = distance, the same for every call, so
    equal inputs give bitwise equal views.

    Raises:  InputError if a ray has no solution or meets the back of the sheet: the settings fold the sheet over.
    """
    ray_x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    ray_y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    rows = max(1, BLOCK_PIXELS // camera.width)  # blocks of rows that stay in the processor's cache
    blocks = [
        see_rays(surface, camera, t, *np.meshgrid(ray_x, ray_y[top : top + rows]))
        for top in range(0, camera.height, rows)
    ]
    view = View(*(np.concatenate(parts, axis=-2) for parts in zip(*blocks)))
    a, b = view.material
    if np.diff(a, axis=1).min() <= 0 or np.diff(b, axis=0).min() <= 0:
        raise InputError(f"simulator: at t = {t:g} the sheet folds over itself: motion or relief is too strong")
    return view


def see_rays(surface: Surface, camera: Camera, t: float, ray_x: FloatArray, ray_y: FloatArray) -> View:
    """The view along chosen rays (ray_x, ray_y, 1) in camera axes, each array of one shape. Raises as `see` does."""
    a, b = _start(surface, camera, ray_x, ray_y)
    for _ in range(MOST_STEPS):
        point, along_a, along_b = _evaluate(surface, a, b, t)
        seen = to_camera(camera, point)
        residual_x, residual_y = seen[0] - ray_x * seen[2], seen[1] - ray_y * seen[2]
        if max(np.abs(residual_x).max(), np.abs(residual_y).max()) < RESIDUAL_TOLERANCE:
            break
        turned_a, turned_b = _rotate(camera.rotation, along_a), _rotate(camera.rotation, along_b)
        xa, ya = turned_a[0] - ray_x * turned_a[2], turned_a[1] - ray_y * turned_a[2]
        xb, yb = turned_b[0] - ray_x * turned_b[2], turned_b[1] - ray_y * turned_b[2]
        determinant = xa * yb - xb * ya
        a = a - (yb * residual_x - xb * residual_y) / determinant
        b = b - (xa * residual_y - ya * residual_x) / determinant
    else:
        raise InputError(f"simulator: at t = {t:g} a ray misses the sheet: motion or relief is too strong")
    normal = np.stack(_cross(along_b, along_a))  # d/db x d/da points to -z, towards the camera
    normal /= np.sqrt((normal**2).sum(axis=0))
    facing = _rotate(camera.rotation, normal)
    if (ray_x * facing[0] + ray_y * facing[1] + facing[2]).max() >= 0 or seen[2].min() <= 0:
        raise InputError(f"simulator: at t = {t:g} a ray meets the back of the sheet: motion or relief is too strong")
    return View(np.stack([a, b]), point, normal, seen[2])


def to_camera(camera: Camera, point: FloatArray) -> FloatArray:
    """World positions (3, ...) in camera axes."""
    return _rotate(camera.rotation, point) + camera.translation.reshape(3, *[1] * (point.ndim - 1))


def _start(surface: Surface, camera: Camera, ray_x: FloatArray, ray_y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Material coordinates at which the rays meet the plane z = distance."""
    direction = _rotate(camera.rotation.T, np.stack([ray_x, ray_y, np.ones_like(ray_x)]))
    centre = -camera.rotation.T @ camera.translation
    length = (surface.distance - centre[2]) / direction[2]
    return centre[0] + length * direction[0], centre[1] + length * direction[1]


def _rotate(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    if np.array_equal(rotation, np.eye(3)):  # the static camera: nothing to do
        return vectors
    x, y, z = vectors
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in rotation])


def _cross(u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


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
    centre = (-0.2 * settings.distance, 0.1 * settings.distance)
    direction = np.array([0.5, 0.2, -0.84])
    course = lambda t: (
        part.amplitude * (np.sin(2 * np.pi * part.cycles * t) + 0.4 * np.sin(4 * np.pi * part.cycles * t))
    )
    return Motion(course, gaussian_weight(centre, part.width), direction / np.linalg.norm(direction))


def _pull(settings: SimulatorSettings) -> Motion:
    part = settings.pull
    centre = (0.06 * settings.distance, 0.04 * settings.distance)
    direction = np.array([0.75, 0.3, -0.59])

    def course(t: float) -> float:
        if not part.start < t < part.stop:
            return 0.0
        phase = (t - part.start) / (part.stop - part.start)
        return part.amplitude * _smooth_step(phase / 0.4) * _smooth_step((1 - phase) / 0.25)

    return Motion(course, gaussian_weight(centre, part.width), direction / np.linalg.norm(direction))


def _smooth_step(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x * x * (3 - 2 * x)
