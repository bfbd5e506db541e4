"""The camera: OpenCV axes (x right, y down, z forward), world-to-camera pose, pinhole intrinsics.

Column i covers [i, i+1) and is sampled at i + 0.5; u = fx x/z + cx in the same coordinates, and
back-projection uses the same rule. The pose stored is world-to-camera: x_camera = rotation @ x_world + translation.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray


class Camera(NamedTuple):
    """A pinhole camera. Lengths in the units of the sequence, focal lengths and principal point in pixels.

    Its pose is from world to camera, x' = rotation @ x + translation, with x' to the right, down and forward.
    """

    rotation: FloatArray  # (3, 3) world-to-camera rotation
    translation: FloatArray  # (3,)   world-to-camera translation, scene units
    fx: float
    fy: float
    cx: float  # principal point, pixels from the left edge of column 0
    cy: float
    width: int
    height: int


class CameraPose(NamedTuple):
    """x' = rotation @ x + translation, in OpenCV axes: from the world, or from another camera, to a camera."""

    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,) scene units


class CameraGrads(NamedTuple):
    """Derivative of a loss with respect to the camera pose; the entries of the rotation matrix are independent."""

    d_rotation: FloatArray  # (3, 3)
    d_translation: FloatArray  # (3,)


def camera_centre(camera: Camera) -> FloatArray:
    """Position of the optical centre in world axes, -rotation^T translation. Shape (3,), scene units."""
    return -camera.rotation.T @ camera.translation


def degrees_between(rotation: FloatArray, other: FloatArray) -> float:
    """Angle in [0, 180] degrees by which two rotations (3, 3) differ: cos = (trace(R_1 R_2^T) - 1) / 2."""
    cosine = (np.trace(rotation @ other.T) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def scale_camera(camera: Camera, width: int, height: int) -> Camera:
    """The same camera for an image resized to width x height (pixel edges stay aligned)."""
    sx, sy = width / camera.width, height / camera.height
    return camera._replace(
        fx=camera.fx * sx, cx=camera.cx * sx, fy=camera.fy * sy, cy=camera.cy * sy, width=width, height=height
    )


def project(camera: Camera, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Image position (u, v) in pixels and view depth z of world positions (3, M); each (M,).

    The inverse of `backproject`, whose column and row are u - 1/2 and v - 1/2.
    Edges:   a point with z <= 0 is not in front of the camera: z is returned unchanged, and (u, v) is meaningless.
    """
    x, y, z = camera.rotation @ points + np.asarray(camera.translation)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        return camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, z


def backproject(camera: Camera, column: FloatArray, row: FloatArray, depth: FloatArray) -> FloatArray:
    """World positions of pixel centres at view depth `depth` (z > 0, scene units).

    column, row   (M,) pixel indices, of whole pixels or between them
    returns       (3, M)
    """
    x = (column + 0.5 - camera.cx) / camera.fx * depth
    y = (row + 0.5 - camera.cy) / camera.fy * depth
    return camera.rotation.T @ (np.stack([x, y, depth]) - camera.translation[:, None])
