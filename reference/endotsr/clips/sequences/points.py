"""Prior depth from structure-from-motion points, sparse or interpolated.

In: the world points that a frame sees. Out: depth (H, W), 0 = none.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import Intrinsics
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

LEAST_POINTS = 4  # for a triangulation


def depth_from_points(points: FloatArray, pose: CameraPose, intrinsics: Intrinsics, method: str) -> NDArray[np.float32]:
    """View-space z at the pixels of the points, or inside their convex hull.

    points   (n, 3) world positions visible in this frame
    intrinsics     without distortion
    method   `sparse`: at the nearest pixel of each point; `interpolated`: 1 / z linear in the picture over a Delaunay
             triangulation, which is exact for planes; 0 outside the hull

    Edges:   fewer than four points, or collinear points, give the sparse depth.
    """
    view = points @ pose.rotation.T + pose.translation
    z = view[:, 2]
    front = z > 0
    u, v = (
        intrinsics.fx * view[front, 0] / z[front] + intrinsics.cx,
        intrinsics.fy * view[front, 1] / z[front] + intrinsics.cy,
    )
    z = z[front]
    if method == "interpolated" and len(z) >= LEAST_POINTS:
        found = _interpolated(u, v, z, intrinsics)
        if found is not None:
            return found
    depth = np.zeros((intrinsics.height, intrinsics.width), np.float32)
    column, row = np.floor(u).astype(np.intp), np.floor(v).astype(np.intp)
    inside = (column >= 0) & (column < intrinsics.width) & (row >= 0) & (row < intrinsics.height)
    order = np.argsort(-z[inside], kind="stable")  # the nearer of two points in one pixel is kept
    depth[row[inside][order], column[inside][order]] = z[inside][order]
    return depth


def _interpolated(u: FloatArray, v: FloatArray, z: FloatArray, intrinsics: Intrinsics) -> NDArray[np.float32] | None:
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    try:
        plane = LinearNDInterpolator(np.column_stack([u, v]), 1.0 / z, fill_value=0.0)
    except QhullError:
        return None
    column, row = np.meshgrid(np.arange(intrinsics.width) + 0.5, np.arange(intrinsics.height) + 0.5)
    inverse = plane(column, row)
    return np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0).astype(np.float32)
