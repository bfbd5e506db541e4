"""The view of the sheet from a camera: for every ray the material point it meets, with position, normal and depth.

In: a surface, a camera, a time. Out: a `SurfaceView`, solved by Newton's method to 1e-10 mm from the ray in x and
y. With an open slit, a ray meets one of its sides or the wound between them.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.slit import half_width, is_open, side_of, slit_coordinates
from endotsr.clips.simulator.surface import Surface, evaluate
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera

TOO_STRONG = "motion or relief is too strong; use smaller ones"
Formula = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
# (p, q) -> position, its derivatives with respect to p and q, each (3, ...)

RESIDUAL_TOLERANCE = 1e-10  # of X_c - p_x Z_c and Y_c - p_y Z_c, mm
MOST_STEPS = 30
BLOCK_PIXELS = 16384


class SurfaceView(NamedTuple):
    """The part of the sheet that a camera sees, per pixel."""

    material: FloatArray  # (2, H, W) material coordinates a, b, mm; in a wound, of the cut at the same x
    point: FloatArray  # (3, H, W) world position, mm
    normal: FloatArray  # (3, H, W) unit normal, towards the camera
    depth: FloatArray  # (H, W) view-space z, mm
    wound: BoolArray | None = None  # (H, W) pixels that show the wound of an open slit; None without one


def see(surface: Surface, camera: Camera, t: float) -> SurfaceView:
    """Intersect every pixel's ray with the sheet by Newton's method on the material coordinates.

    The equations X_c - p_x Z_c = 0, Y_c - p_y Z_c = 0 are solved for (a, b), where (X_c, Y_c, Z_c) is X(a, b, t) in
    camera axes and (p_x, p_y, 1) is the ray through the pixel centre. Every solution starts on the plane z = distance:
    equal inputs give bitwise equal views.

    Raises:  InputError if a ray has no solution or meets the back of the sheet, because the settings fold the sheet.
    """
    ray_x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    ray_y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    rows = max(1, BLOCK_PIXELS // camera.width)  # blocks of rows, so that the arrays between the steps are small
    blocks = [
        see_rays(surface, camera, t, *np.meshgrid(ray_x, ray_y[top : top + rows]))
        for top in range(0, camera.height, rows)
    ]
    material, point, normal, depth = (np.concatenate(parts, axis=-2) for parts in list(zip(*blocks))[:4])
    wounds = [block.wound for block in blocks if block.wound is not None]
    view = SurfaceView(material, point, normal, depth, np.concatenate(wounds) if wounds else None)
    a, b = view.material if view.wound is None else np.where(view.wound, np.nan, view.material)
    if np.nanmin(np.diff(a, axis=1)) <= 0 or np.nanmin(np.diff(b, axis=0)) <= 0:
        raise InputError(f"simulator: at t = {t:g} the sheet folds over itself: {TOO_STRONG}")
    return view


def see_rays(surface: Surface, camera: Camera, t: float, ray_x: FloatArray, ray_y: FloatArray) -> SurfaceView:
    """The view along rays (ray_x, ray_y, 1) in camera axes; both arrays have the same shape. Raises as `see` does."""
    if surface.slit is not None and is_open(surface.slit, t):
        return _see_cut(surface, camera, t, ray_x, ray_y)
    return see_side(surface, camera, t, ray_x, ray_y)


def see_side(
    surface: Surface, camera: Camera, t: float, ray_x: FloatArray, ray_y: FloatArray, side: FloatArray | None = None
) -> SurfaceView:
    """The view of the sheet alone, with the side of an open slit given per ray and continued beyond its edge."""
    start = _start(surface, camera, ray_x, ray_y)
    return _meet(lambda a, b: evaluate(surface, a, b, t, side), camera, t, ray_x, ray_y, start)


def see_wound(surface: Surface, camera: Camera, t: float, ray_x: FloatArray, ray_y: FloatArray) -> SurfaceView:
    """The view of the wound of an open slit along rays that pass between its edges.

    The wound is a groove between the two edges. Its point at x along and y across the slit is X(x) + y across + depth
    (w^2 - y^2) / h^2 in z, where X(x) is the point of the line, moved by all motions except the slit, w is the half
    width of the slit at x and h the largest half width.
    """
    slit = surface.slit
    assert slit is not None
    whole = surface._replace(slit=None)
    across = np.array([*slit.across, 0.0]).reshape(3, *[1] * ray_x.ndim)

    def wound(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        a, b = slit.centre[0] + x * slit.along[0], slit.centre[1] + x * slit.along[1]
        point, by_a, by_b = evaluate(whole, a, b, t)
        along = by_a * slit.along[0] + by_b * slit.along[1]
        width, slope = half_width(slit, x, t)
        scale = slit.depth / slit.half_opening**2
        point, aside = point + y * across, np.zeros_like(point) + across
        point[2] += scale * (width**2 - y**2)
        along[2] += scale * 2 * width * slope
        aside[2] -= scale * 2 * y
        return point, along, aside

    a, b = _start(surface, camera, ray_x, ray_y)
    x, y = slit_coordinates(slit, a, b)
    view = _meet(wound, camera, t, ray_x, ray_y, (x, np.clip(y, -slit.half_opening, slit.half_opening)))
    x = view.material[0]
    material = np.stack([slit.centre[0] + x * slit.along[0], slit.centre[1] + x * slit.along[1]])
    return view._replace(material=material, wound=np.ones(x.shape, bool))


def _see_cut(surface: Surface, camera: Camera, t: float, ray_x: FloatArray, ray_y: FloatArray) -> SurfaceView:
    """The view along rays with an open slit: on the initial side of a ray, else the other side, else the wound.

    The two sides cover different parts of the picture. A solution on the assumed side is therefore unique.
    """
    slit = surface.slit
    assert slit is not None
    side = side_of(slit, *_start(surface, camera, ray_x, ray_y))
    view = see_side(surface, camera, t, ray_x, ray_y, side)
    view = view._replace(wound=np.zeros(ray_x.shape, bool))
    missed = side * slit_coordinates(slit, *view.material)[1] < 0
    if missed.any():
        other = see_side(surface, camera, t, ray_x[missed], ray_y[missed], -side[missed])
        other = other._replace(wound=-side[missed] * slit_coordinates(slit, *other.material)[1] < 0)
        put(view, missed, other)
    assert view.wound is not None
    gap = view.wound.copy()
    if gap.any():
        put(view, gap, see_wound(surface, camera, t, ray_x[gap], ray_y[gap]))
    return view


def view_of_points(surface: Surface, camera: Camera, material: FloatArray, t: float) -> SurfaceView:
    """The view of given material points (2, P), visible or not, as a picture with one row."""
    a, b = material[:, None]
    point, along_a, along_b = evaluate(surface, a, b, t)
    normal = np.stack(_cross(along_b, along_a))
    normal /= np.sqrt((normal**2).sum(axis=0))
    return SurfaceView(material[:, None], point, normal, to_camera(camera, point)[2])


def put(view: SurfaceView, where: BoolArray, other: SurfaceView) -> None:
    """Overwrite the chosen pixels of a view with those of another, in place."""
    for target, source in zip(view, other):
        if target is not None:
            target[..., where] = source


def _meet(
    formula: Formula,
    camera: Camera,
    t: float,
    ray_x: FloatArray,
    ray_y: FloatArray,
    start: tuple[FloatArray, FloatArray],
) -> SurfaceView:
    """The points where rays meet a surface given by a formula; `material` contains its two coordinates."""
    a, b = start
    for _ in range(MOST_STEPS):
        point, along_a, along_b = formula(a, b)
        seen = to_camera(camera, point)
        residual_x, residual_y = seen[0] - ray_x * seen[2], seen[1] - ray_y * seen[2]
        if max(np.abs(residual_x).max(initial=0), np.abs(residual_y).max(initial=0)) < RESIDUAL_TOLERANCE:
            break
        turned_a, turned_b = rotate(camera.rotation, along_a), rotate(camera.rotation, along_b)
        xa, ya = turned_a[0] - ray_x * turned_a[2], turned_a[1] - ray_y * turned_a[2]
        xb, yb = turned_b[0] - ray_x * turned_b[2], turned_b[1] - ray_y * turned_b[2]
        determinant = xa * yb - xb * ya
        a = a - (yb * residual_x - xb * residual_y) / determinant
        b = b - (xa * residual_y - ya * residual_x) / determinant
    else:
        raise InputError(f"simulator: at t = {t:g} a ray misses the sheet: {TOO_STRONG}")
    normal = np.stack(_cross(along_b, along_a))  # d/db x d/da points to -z, towards the camera
    normal /= np.sqrt((normal**2).sum(axis=0))
    facing = rotate(camera.rotation, normal)
    away = ray_x * facing[0] + ray_y * facing[1] + facing[2]
    if away.max(initial=-1) >= 0 or seen[2].min(initial=1) <= 0:
        raise InputError(f"simulator: at t = {t:g} a ray meets the back of the sheet: {TOO_STRONG}")
    return SurfaceView(np.stack([a, b]), point, normal, seen[2])


def to_camera(camera: Camera, point: FloatArray) -> FloatArray:
    """World positions (3, ...) in camera axes."""
    return rotate(camera.rotation, point) + camera.translation.reshape(3, *[1] * (point.ndim - 1))


def pixel_of(camera: Camera, point: FloatArray) -> FloatArray:
    """u, v in pixels and view-space z of world positions, stacked: (3, ...) to (3, ...); u, v are NaN for z <= 0."""
    x, y, z = to_camera(camera, point)
    in_front = np.where(z > 0, z, np.nan)
    return np.stack([camera.fx * x / in_front + camera.cx, camera.fy * y / in_front + camera.cy, z])


def _start(surface: Surface, camera: Camera, ray_x: FloatArray, ray_y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Material coordinates where the rays meet the plane z = distance."""
    direction = rotate(camera.rotation.T, np.stack([ray_x, ray_y, np.ones_like(ray_x)]))
    centre = -camera.rotation.T @ camera.translation
    length = (surface.distance - centre[2]) / direction[2]
    return centre[0] + length * direction[0], centre[1] + length * direction[1]


def rotate(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors (3, ...) rotated by a matrix. The identity returns them unchanged."""
    if np.array_equal(rotation, np.eye(3)):  # the static camera: nothing to do
        return vectors
    x, y, z = vectors
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in rotation])


def _cross(u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
