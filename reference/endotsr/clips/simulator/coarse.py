"""Views for rendering only, solved on every fourth pixel and interpolated.

The ground truth is solved at every pixel (views.py). The right camera and motion blur need the geometry only for
rendering. There, cubic polynomials through the nodes interpolate the sheet, whose shortest folds are 11 mm long. At an
open slit, each side is solved separately and continued beyond its edge.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from endotsr.clips.simulator.slit import is_open, slit_coordinates
from endotsr.clips.simulator.surface import Surface
from endotsr.clips.simulator.views import SurfaceView, put, rotate, see_side, see_wound
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera

STEP = 4  # pixels between two nodes
GEOMETRY = ("material", "point", "normal", "depth")


def see_coarsely(surface: Surface, camera: Camera, t: float) -> SurfaceView:
    """As `views.see`, to a few hundredths of a pixel from 160 columns on. Raises InputError as `see_rays` does.

    The nodes are `STEP` pixels apart, and a pixel of a small picture covers more of the tissue: the error grows to
    tenths of a pixel below 64 columns.
    """
    ray_x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    ray_y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    x, y = np.meshgrid(ray_x, ray_y)
    rays = (x, y)
    slit = surface.slit
    if slit is None or not is_open(slit, t):
        return _spread_view(surface, camera, t, rays, None)
    view = _spread_view(surface, camera, t, rays, 1.0)
    minus = _spread_view(surface, camera, t, rays, -1.0)
    missed = slit_coordinates(slit, *view.material)[1] < 0
    put(view, missed, minus._replace(**{name: getattr(minus, name)[..., missed] for name in GEOMETRY}))
    gap = missed & (slit_coordinates(slit, *minus.material)[1] > 0)
    view = view._replace(wound=gap)
    if gap.any():
        put(view, gap, see_wound(surface, camera, t, rays[0][gap], rays[1][gap]))
    return view


def views_during(
    surface: Surface, cameras: list[Camera], view: SurfaceView, t: float, times: FloatArray
) -> Iterator[SurfaceView]:
    """The view at every time of an exposure: the visible material, with position and normal at mid-exposure.

    cameras  at the first time, at t and at the last time
    view     the view at t
    times    relative to t, normalised time, ascending and symmetric

    The material coordinates of a pixel follow the parabola in time through the values at the three cameras' times.
    """
    slit = surface.slit
    cut = slit is not None and is_open(slit, t + times[-1])
    sides = (1.0, -1.0) if cut else (None,)
    instants = t + times[0], t, t + times[-1]
    paths = [[_seen_at_nodes(surface, *at, side).material for at in zip(cameras, instants)] for side in sides]
    for u in times / times[-1]:
        weights = 0.5 * u * (u - 1), 1 - u**2, 0.5 * u * (u + 1)
        found = [spread(np.asarray(sum(w * m for w, m in zip(weights, path))), cameras[1]) for path in paths]
        if slit is None or not cut:
            yield view._replace(material=found[0], wound=None)
            continue
        below = slit_coordinates(slit, *found[0])[1] < 0
        gap = below & (slit_coordinates(slit, *found[1])[1] > 0)
        yield view._replace(material=np.where(below, found[1], found[0]), wound=gap)


def nodes(count: int) -> FloatArray:
    """Image coordinates of the nodes along a side of `count` pixels: every `STEP`-th pixel centre, and beyond the ends.

    Of the four nodes of a pixel, one is before its centre, one at or before it, and two are after it.
    """
    return 0.5 + STEP * (np.arange((count - 1) // STEP + 4) - 1)


def spread(values: FloatArray, camera: Camera) -> FloatArray:
    """Values at the nodes, (C, rows, columns), interpolated at all pixel centres: (C, H, W)."""
    channels, rows, columns = values.shape
    across, down = _interpolation(camera.width), _interpolation(camera.height)
    wide = across @ values.transpose(2, 0, 1).reshape(columns, -1)
    high = down @ wide.reshape(-1, channels, rows).transpose(2, 1, 0).reshape(rows, -1)
    return np.ascontiguousarray(high.reshape(camera.height, channels, -1).transpose(1, 0, 2))


def _spread_view(
    surface: Surface, camera: Camera, t: float, rays: tuple[FloatArray, FloatArray], side: float | None
) -> SurfaceView:
    coarse = _seen_at_nodes(surface, camera, t, side)
    fine = spread(np.concatenate([coarse.material, coarse.normal, coarse.depth[None]]), camera)
    normal, depth = fine[2:5], fine[5]
    normal /= np.sqrt((normal**2).sum(axis=0))
    seen = np.stack([rays[0] * depth, rays[1] * depth, depth]) - camera.translation[:, None, None]
    return SurfaceView(fine[:2], rotate(camera.rotation.T, seen), normal, depth)


def _seen_at_nodes(surface: Surface, camera: Camera, t: float, side: float | None) -> SurfaceView:
    """The view at the nodes, (rows, columns), of the sheet or of one side of an open slit."""
    x, y = np.meshgrid((nodes(camera.width) - camera.cx) / camera.fx, (nodes(camera.height) - camera.cy) / camera.fy)
    return see_side(surface, camera, t, x, y, None if side is None else np.full_like(x, side))


def _interpolation(count: int) -> Any:
    """Sparse matrix (pixels, nodes) of the cubic polynomial through the four nearest nodes."""
    from scipy.sparse import csr_array

    pixel = np.arange(count)
    f = (pixel % STEP) / STEP
    weights = np.stack(
        [
            -f * (f - 1) * (f - 2) / 6,
            (f + 1) * (f - 1) * (f - 2) / 2,
            -(f + 1) * f * (f - 2) / 2,
            (f + 1) * f * (f - 1) / 6,
        ],
        axis=1,
    )
    columns = (pixel // STEP)[:, None] + np.arange(4)
    shape = (count, len(nodes(count)))
    return csr_array((weights.ravel(), columns.ravel(), 4 * np.arange(count + 1)), shape=shape)
