"""The visible surface at one time as a triangle mesh, by volumetric fusion of rendered depth.

In: a scene, a time, and the cameras of its frames: the first one if the camera is static, else evenly spaced ones. Each
renders depth divided by opacity. The truncated signed distances (Curless and Levoy, 1996) are averaged in a voxel grid,
and marching cubes of scikit-image extracts the zero level set. Out: vertices, triangles and colours of the observed
surface. scikit-image is an optional package (`pip install 'endotsr[mesh]'`), imported on first use.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import Camera, backproject, project
from endotsr.results.evaluation.depth import LEAST_OPACITY, normalised_depth
from endotsr.results.export.scene import MovingScene

MOST_VOXELS = 1 << 24
MOST_VIEWS = 32  # maximum number of fused cameras of a moving clip, evenly spaced
PIXELS_A_VOXEL = 1.5  # side of a voxel, in pixels at the median depth
TRUNCATION = 4.0  # truncation distance, in voxels
SLAB = 1 << 20  # voxels processed at once


class DepthView(NamedTuple):
    """Depth and colour rendered from one camera."""

    camera: Camera
    depth: FloatArray  # (H, W) view-space z, scene units; 0 = none
    colour: FloatArray  # (3, H, W) display units [0, 1]


class Mesh(NamedTuple):
    """Triangles of a surface, counter-clockwise seen from the cameras."""

    vertices: FloatArray  # (V, 3) float32, scene units
    faces: NDArray[np.int32]  # (F, 3) indices into `vertices`
    colours: NDArray[np.uint8]  # (V, 3) red, green, blue


class Grid(NamedTuple):
    """Corners of the voxels: `low + side * (i, j, k)`."""

    low: FloatArray  # (3,) scene units
    side: float  # scene units
    shape: tuple[int, int, int]


def surface(scene: MovingScene, time: float, voxel: float | None = None, taken_out: tuple[str, ...] = ()) -> Mesh:
    """The visible surface of a scene at `time` in [0, 1].

    voxel        side of a voxel in scene units; None: `PIXELS_A_VOXEL` pixels, larger if the grid would be too large
    taken_out    spectral components to leave out
    Raises: InputError without scikit-image, without a surface, or for a voxel that is too small.
    """
    cameras = scene.cameras
    chosen = cameras[:1] if scene.record.static_camera else cameras[:: -(-len(cameras) // MOST_VIEWS)]
    return fused([depth_view(scene, time, camera, taken_out) for camera in chosen], voxel)


def depth_view(scene: MovingScene, time: float, camera: Camera, taken_out: tuple[str, ...] = ()) -> DepthView:
    """Render depth divided by opacity (0 below `LEAST_OPACITY`) and colour."""
    out = scene.render(time, camera, taken_out)
    return DepthView(camera, normalised_depth(out, LEAST_OPACITY), out.colour)


def fused(views: list[DepthView], voxel: float | None = None) -> Mesh:
    """The surface of several depth views; see `surface`."""
    from scipy.ndimage import binary_erosion

    try:
        from skimage.measure import marching_cubes
    except ImportError:
        raise InputError(
            "export: --content mesh needs scikit-image; install it with pip install 'endotsr[mesh]'"
        ) from None
    grid = _grid(views, voxel)
    distance, weight = _distances(views, grid)
    # The border of the observed region is no surface: use only cells whose whole neighbourhood was observed.
    known = binary_erosion(weight > 0, np.ones((3, 3, 3)))
    try:
        corners, faces, _, _ = marching_cubes(distance, 0.0, mask=known, gradient_direction="descent")
    except (RuntimeError, ValueError):  # its two ways to say that no cell holds the surface
        raise InputError(
            f"export: no surface in a grid of {'x'.join(map(str, grid.shape))} voxels of side {grid.side:.3g};"
            " use a smaller --voxel"
        ) from None
    vertices = grid.low + grid.side * corners
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32), _colours(views, vertices, grid.side))


def _grid(views: list[DepthView], voxel: float | None) -> Grid:
    """A grid around all observed points."""
    if not any((view.depth > 0).any() for view in views):
        raise InputError("export: no surface at this time; the rendered views have no depth")
    points = np.concatenate([_points(view) for view in views], axis=1)
    low, high = points.min(axis=1), points.max(axis=1)
    footprint = np.median(np.concatenate([v.depth[v.depth > 0] / v.camera.fx for v in views]))
    if voxel is None:
        side = PIXELS_A_VOXEL * float(footprint)
        while _voxels(high - low, side) > MOST_VOXELS:
            side *= 1.1
    elif voxel > 0 and _voxels(high - low, voxel) <= MOST_VOXELS:
        side = voxel
    else:
        raise InputError(
            f"export: --voxel {voxel:g} is not allowed; use a number > 0 for a grid of at most {MOST_VOXELS} "
            f"voxels; {PIXELS_A_VOXEL * float(footprint):.3g} corresponds to {PIXELS_A_VOXEL:g} pixels"
        )
    margin = TRUNCATION * side
    counts = np.ceil((high - low + 2 * margin) / side).astype(int) + 1
    return Grid(low - margin, side, (int(counts[0]), int(counts[1]), int(counts[2])))


def _voxels(extent: FloatArray, side: float) -> float:
    return float(np.prod(extent / side + 2 * TRUNCATION + 2))


def _points(view: DepthView) -> FloatArray:
    row, column = np.nonzero(view.depth > 0)
    return backproject(view.camera, column.astype(float), row.astype(float), view.depth[row, column].astype(float))


def _distances(views: list[DepthView], grid: Grid) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean truncated signed distance in units of the truncation (1 = free or unobserved), and its number of views."""
    total, weight = np.zeros(grid.shape, np.float32), np.zeros(grid.shape, np.float32)
    for part, points in _slabs(grid):
        for view in views:
            z, depth = _looked_up(view, points)
            distance = (depth - z) / (TRUNCATION * grid.side)
            known = ((depth > 0) & (distance >= -1)).reshape(total[part].shape)
            total[part] += np.where(known, np.minimum(distance, 1).reshape(known.shape), 0)
            weight[part] += known
    return np.where(weight > 0, total / np.maximum(weight, 1), 1).astype(np.float32), weight


def _slabs(grid: Grid) -> Iterator[tuple[slice, FloatArray]]:
    """Slices of the first axis, with the corners of each, (3, M)."""
    step = max(1, SLAB // (grid.shape[1] * grid.shape[2]))
    for start in range(0, grid.shape[0], step):
        part = slice(start, min(start + step, grid.shape[0]))
        index = np.mgrid[part, : grid.shape[1], : grid.shape[2]].reshape(3, -1)
        yield part, grid.low[:, None] + grid.side * index


def _projected(camera: Camera, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """View-space z of points (3, M), and their (row, column) for `map_coordinates`."""
    u, v, z = project(camera, points)
    return z, np.where(z > 0, np.stack([v, u]) - 0.5, 0)


def _looked_up(view: DepthView, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """View-space z of points (3, M), and the rendered depth at their pixels: bilinear, 0 next to missing depth."""
    from scipy.ndimage import map_coordinates

    z, place = _projected(view.camera, points)
    there = map_coordinates((view.depth > 0).astype(np.float32), place, order=1)
    depth = map_coordinates(np.asarray(view.depth, np.float32), place, order=1)
    return z, np.where((z > 0) & (there > 0.999), depth, 0)


def _colours(views: list[DepthView], vertices: FloatArray, side: float) -> NDArray[np.uint8]:
    """Mean colour of each vertex over the views that observe it, (V, 3); mid-grey without a view."""
    from scipy.ndimage import map_coordinates

    total, count = np.zeros((3, len(vertices))), np.zeros(len(vertices))
    for view in views:
        z, depth = _looked_up(view, vertices.T)
        _, place = _projected(view.camera, vertices.T)
        seen = (depth > 0) & (np.abs(depth - z) < TRUNCATION * side)
        total += seen * np.stack([map_coordinates(plane, place, order=1, mode="nearest") for plane in view.colour])
        count += seen
    mean = np.where(count > 0, total / np.maximum(count, 1), 0.5)
    return np.rint(np.clip(mean, 0, 1) * 255).astype(np.uint8).T
