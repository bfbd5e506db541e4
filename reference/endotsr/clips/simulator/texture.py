"""The appearance of the tissue: colour and fine relief over material coordinates, in one tabulated map.

The map combines smooth random fields (cubic B-splines over a lattice in millimetres) and random vessel trees. Random
numbers are drawn per millimetre, not per pixel: a larger image of the same aspect ratio samples the same tissue more
finely.
"""

from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit

FLESH = np.array([0.62, 0.20, 0.15])  # linear reflectances
PALE = np.array([0.80, 0.42, 0.28])
FAT = np.array([0.85, 0.62, 0.28])
ARTERY = np.array([0.42, 0.03, 0.03])
VEIN = np.array([0.26, 0.05, 0.10])
FINEST_STEP = 0.08  # mm; half the radius with which the thinnest vessel trees begin
SPLINE_DEVIATION = 0.479  # standard deviation of a two-dimensional cubic B-spline field with unit normal weights


class Texture(NamedTuple):
    """Maps over material coordinates, sampled bilinearly. Outside the maps, the border value is used."""

    values: NDArray[np.float32]  # (rows, columns, 5) linear RGB reflectance; relief slopes along a and b
    origin: tuple[float, float]  # material coordinates (a, b) of texel [0, 0], mm
    step: tuple[float, float]  # mm per texel along a and b


def make_texture(settings: SimulatorSettings) -> Texture:
    """The texture of the part of the sheet in view, with a margin for motion."""
    pixel = settings.distance / (settings.focal * settings.width)
    step = max(0.5 * pixel, FINEST_STEP)
    half_a, half_b = half_extent(settings)
    # linspace: the ends, hence all random numbers, are the same for every size of one aspect ratio
    a = np.linspace(-half_a, half_a, round(2 * half_a / step) + 1)
    b = np.linspace(-half_b, half_b, round(2 * half_b / step) + 1)
    rng = np.random.default_rng([settings.seed, 1])
    colour = _colour(a, b, rng)
    slope_a, slope_b = _fine_relief(a, b, rng)
    values = np.stack([*colour, slope_a, slope_b], axis=2).astype(np.float32)
    return Texture(values, (float(a[0]), float(b[0])), (float(a[1] - a[0]), float(b[1] - b[0])))


def half_extent(settings: SimulatorSettings) -> tuple[float, float]:
    """Half the extent of the texture along a and b, mm."""
    pixel = settings.distance / (settings.focal * settings.width)
    return 0.5 * settings.width * pixel * 1.2 + 8.0, 0.5 * settings.height * pixel * 1.2 + 8.0


def sample(texture: Texture, material: FloatArray) -> FloatArray:
    """All five maps at material coordinates (2, H, W), bilinear: (5, H, W) float64. NaN counts as the first texel."""
    found = np.empty((texture.values.shape[2], *material.shape[1:]))
    sample_kernel(texture.values, texture.origin, texture.step, np.ascontiguousarray(material), found)
    return found


def _sample_kernel(
    values: FloatArray, origin: tuple[float, float], step: tuple[float, float], material: FloatArray, out: FloatArray
) -> None:
    """Fill `out` pixel by pixel. Compiled, because motion blur samples the maps at every time of the exposure."""
    rows, columns, maps = values.shape
    for i in range(material.shape[1]):
        for j in range(material.shape[2]):
            x, y = (material[0, i, j] - origin[0]) / step[0], (material[1, i, j] - origin[1]) / step[1]
            x, y = x if x > 0.0 else 0.0, y if y > 0.0 else 0.0
            x, y = min(x, columns - 1.001), min(y, rows - 1.001)
            left, top = int(x), int(y)
            across, down = x - left, y - top
            for k in range(maps):
                upper = values[top, left, k] * (1 - across) + values[top, left + 1, k] * across
                lower = values[top + 1, left, k] * (1 - across) + values[top + 1, left + 1, k] * across
                out[k, i, j] = upper * (1 - down) + lower * down


sample_kernel = jit(_sample_kernel)


def _colour(a: FloatArray, b: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Linear reflectance (3, rows, columns)."""
    mottle = sum(
        weight * _field(a, b, rng, spacing) for spacing, weight in ((14, 0.5), (6, 0.35), (2.5, 0.25), (1, 0.15))
    )
    colour = _mix(FLESH[:, None, None], PALE[:, None, None], 1 / (1 + np.exp(-1.6 * mottle)))
    fat = _field(a, b, rng, 11) + 0.35 * _field(a, b, rng, 2)
    colour = _mix(colour, FAT[:, None, None], 0.7 / (1 + np.exp(-5 * (fat - 1.3))))
    colour = colour * (1 + 0.07 * _field(a, b, rng, 0.7))
    for tint, count, width, strength in ((VEIN, 7, 1.1, 0.6), (ARTERY, 6, 0.55, 0.75), (ARTERY, 12, 0.3, 0.5)):
        colour = _mix(colour, tint[:, None, None], strength * _vessels(a, b, rng, count, width))
    return np.clip(colour, 0.01, 0.95)


def _fine_relief(a: FloatArray, b: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Slopes of the fine relief of the wet surface. They affect only the normals of highlights, not the geometry."""
    slope_a, slope_b = np.zeros((len(b), len(a))), np.zeros((len(b), len(a)))
    for spacing, slope in ((5.0, 0.20), (2.2, 0.14), (0.9, 0.05)):
        da, db = _field_slopes(a, b, rng, spacing)
        slope_a += slope * spacing * da
        slope_b += slope * spacing * db
    return slope_a, slope_b


def _field(a: FloatArray, b: FloatArray, rng: np.random.Generator, spacing: float) -> FloatArray:
    """A smooth random field (rows, columns) with standard deviation about 1 and features of `spacing` mm."""
    over_a, over_b = spline_basis(a, spacing)[0], spline_basis(b, spacing)[0]
    return over_b @ _lattice(rng, over_a, over_b) @ over_a.T


def _field_slopes(
    a: FloatArray, b: FloatArray, rng: np.random.Generator, spacing: float
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of such a field with respect to a and b, per mm."""
    over_a, slope_a = spline_basis(a, spacing)
    over_b, slope_b = spline_basis(b, spacing)
    lattice = _lattice(rng, over_a, over_b)
    return over_b @ lattice @ slope_a.T, slope_b @ lattice @ over_a.T


def _lattice(rng: np.random.Generator, over_a: FloatArray, over_b: FloatArray) -> FloatArray:
    return rng.standard_normal((over_b.shape[1], over_a.shape[1])) / SPLINE_DEVIATION


def spline_basis(x: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Cubic B-splines on knots that cover x, and their derivatives: two (len(x), knots) matrices."""
    position = (x - x[0]) / spacing
    distance = position[:, None] - np.arange(-1, int(position[-1]) + 3)
    r = np.abs(distance)
    near, far = r < 1, (r >= 1) & (r < 2)
    value = np.where(near, 2 / 3 - r**2 + r**3 / 2, np.where(far, (2 - r) ** 3 / 6, 0.0))
    slope = np.where(near, -2 * r + 1.5 * r**2, np.where(far, -((2 - r) ** 2) / 2, 0.0)) * np.sign(distance)
    return value, slope / spacing


def _vessels(a: FloatArray, b: FloatArray, rng: np.random.Generator, count: int, width: float) -> FloatArray:
    """Coverage in [0, 1] of `count` winding, branching vessels of about `width` mm."""
    from scipy.ndimage import distance_transform_edt

    step = a[1] - a[0]
    points, radii = _vessel_paths(a, b, rng, count, width)
    column = np.rint((points[0] - a[0]) / step).astype(np.intp)
    row = np.rint((points[1] - b[0]) / (b[1] - b[0])).astype(np.intp)
    inside = (column >= 0) & (column < len(a)) & (row >= 0) & (row < len(b))
    radius_map = np.zeros((len(b), len(a)))
    radius_map[row[inside], column[inside]] = radii[inside]
    distance, nearest = cast(
        tuple[FloatArray, FloatArray], distance_transform_edt(radius_map == 0, return_indices=True)
    )
    radius = radius_map[nearest[0], nearest[1]]
    edge = np.maximum(0.3 * radius, 0.7 * step)
    return 1 / (1 + np.exp(np.clip((distance * step - radius) / (0.4 * edge), -40, 40)))


def _vessel_paths(
    a: FloatArray, b: FloatArray, rng: np.random.Generator, count: int, width: float
) -> tuple[FloatArray, FloatArray]:
    """Centre-line points (2, P) and radii (P,) of random walks with persistent heading and occasional branches."""
    stride = 0.04  # mm; denser than any texel
    walks = [
        (rng.uniform(a[0], a[-1]), rng.uniform(b[0], b[-1]), rng.uniform(0, 2 * np.pi), 0.5 * width, 2)
        for _ in range(count)
    ]
    points, radii = [], []
    while walks:
        x, y, heading, radius, generation = walks.pop()
        length = int(rng.uniform(0.5, 1.0) * 55.0 * (0.45 ** (2 - generation)) / stride)
        bend = np.convolve(rng.standard_normal(length + 40), np.ones(40) / 40, "valid")[:length]
        angle = heading + np.cumsum(bend) * 0.045
        path = np.stack([x + np.cumsum(np.cos(angle)) * stride, y + np.cumsum(np.sin(angle)) * stride])
        taper = radius * np.linspace(1.0, 0.55, length)
        points.append(path)
        radii.append(taper)
        if generation > 0:
            for at in rng.integers(length // 6, length, size=2 + generation):
                turn = rng.choice([-1, 1]) * rng.uniform(0.4, 0.9)
                start = (float(path[0, at]), float(path[1, at]), float(angle[at] + turn))
                walks.append((*start, float(0.7 * taper[at]), generation - 1))
    return np.concatenate(points, axis=1), np.concatenate(radii)


def _mix(under: FloatArray, over: FloatArray, fraction: FloatArray) -> FloatArray:
    return under * (1 - fraction) + over * fraction
