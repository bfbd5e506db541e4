"""Equation (B19): the residual of two frames, one registered on the other by depth and a relative pose.

In: points of the source frame with their values, the picture of the target frame, and the pose of the target camera
relative to the source camera. Out: for every point, the difference between the picture at its projection and its value.
The picture is interpolated by Keys' cubic convolution, whose slope is continuous. Depth and pictures are held fixed.
`clips.poses` minimises this residual over the poses of a clip.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit, jit_formula
from endotsr.method.splatting.camera import Camera

BEFORE, BEYOND = 1, 2  # pixels that the interpolation takes before and beyond the pixel of a position
LENS = 4  # fx, fy, cx, cy


class RegistrationSaved(NamedTuple):
    """Inputs in float64, and the slope of every residual at the point in target axes."""

    rotation: FloatArray  # (3, 3)
    points: FloatArray  # (3, M)
    slope: FloatArray  # (3, M) change of the residual per scene unit of the point; 0 where not seen
    seen: NDArray[np.bool_]  # (M,) in front of the camera and far enough from the edge of the picture


class RegistrationGrads(NamedTuple):
    """Derivatives with respect to all inputs but the picture and the camera."""

    d_rotation: FloatArray  # (3, 3)
    d_translation: FloatArray  # (3,)
    d_points: FloatArray  # (3, M)
    d_reference: FloatArray  # (M,)


@jit_formula
def cubic_weights(f):
    """Weights of the four neighbours at offsets -1, 0, 1, 2 for a position f in [0, 1) after the second, and slopes."""
    g = 1 - f
    weights = (
        -0.5 * f * g * g,
        1 + f * f * (1.5 * f - 2.5),
        1 + g * g * (1.5 * g - 2.5),
        -0.5 * g * f * f,
    )  # fmt: skip
    slopes = (
        -0.5 * g * (g - 2 * f),
        f * (4.5 * f - 5),
        -g * (4.5 * g - 5),
        -0.5 * f * (2 * g - f),
    )  # fmt: skip
    return weights, slopes


@jit_formula
def sample_cubic(picture, x, y):
    """Value and slopes (per pixel, along x and y) of a picture (H, W) at column x, row y; 0 = centre of the first."""
    left, top = int(np.floor(x)), int(np.floor(y))
    across, across_slope = cubic_weights(x - left)
    down, down_slope = cubic_weights(y - top)
    value = slope_x = slope_y = 0.0
    for b in range(4):
        row = slope = 0.0
        for a in range(4):
            pixel = picture[top + b - BEFORE, left + a - BEFORE]
            row += across[a] * pixel
            slope += across_slope[a] * pixel
        value += down[b] * row
        slope_x += down[b] * slope
        slope_y += down_slope[b] * row
    return value, slope_x, slope_y


@jit_formula
def move_point(rotation, translation, x, y, z):
    """rotation (x, y, z) + translation, as three numbers."""
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0],
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1],
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2],
    )


@jit_formula
def register_point(x, y, z, lens, picture):
    """Whether a point in target axes is seen, the picture there, and its slope per scene unit along x, y, z."""
    if not z > 0:
        return False, 0.0, 0.0, 0.0, 0.0
    u, v = lens[0] * x / z + lens[2] - 0.5, lens[1] * y / z + lens[3] - 0.5
    if not (u >= BEFORE and u < picture.shape[1] - BEYOND and v >= BEFORE and v < picture.shape[0] - BEYOND):
        return False, 0.0, 0.0, 0.0, 0.0
    value, slope_u, slope_v = sample_cubic(picture, u, v)
    slope_x, slope_y = slope_u * lens[0] / z, slope_v * lens[1] / z
    return True, value, slope_x, slope_y, -(slope_x * x + slope_y * y) / z


def _register(first, stop, rotation, translation, points, reference, picture, lens, out, slope, seen):
    for k in range(first, stop):
        x, y, z = move_point(rotation, translation, points[0, k], points[1, k], points[2, k])
        inside, value, along_x, along_y, along_z = register_point(x, y, z, lens, picture)
        seen[k] = inside
        out[k] = value - reference[k] if inside else 0.0
        slope[0, k], slope[1, k], slope[2, k] = along_x, along_y, along_z


register_kernel = jit(_register)


def registration_forward(
    rotation: FloatArray,
    translation: FloatArray,
    points: FloatArray,
    reference: FloatArray,
    picture: FloatArray,
    camera: Camera,
) -> tuple[FloatArray, RegistrationSaved]:
    """Equation (B19): residual = picture(projection of rotation points + translation) - reference.

    rotation     (3, 3)  from source to target axes; every entry is independent
    translation  (3,)    scene units
    points       (3, M)  in the axes of the source camera, scene units, finite
    reference    (M,)    values of the points in the source picture, unit of the picture
    picture      (H, W)  of the target frame
    camera       intrinsics of the target frame; its pose is not used
    returns      (M,) residuals, unit of the picture, float64; and the saved tuple

    Reverse: registration_reverse, below.
    Edges:   a point that is not seen has residual 0: z <= 0, a projection less than one pixel from the centre of a
             pixel at the left or upper edge, or at most one from one at the right or lower edge.
    Raises:  ValueError if the shapes disagree.
    Oracle:  `endotsr.definition.registration`
    """
    count = points.shape[1]
    if points.shape[0] != 3 or reference.shape != (count,):
        raise ValueError(f"points {points.shape} and reference {reference.shape}: (3, M) and (M,) expected")
    w, d, x, i = (np.ascontiguousarray(a, np.float64) for a in (rotation, translation, points, reference))
    out, slope, seen = np.empty(count), np.empty((3, count)), np.empty(count, np.bool_)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    register_kernel(0, count, w, d, x, i, np.ascontiguousarray(picture), lens, out, slope, seen)
    return out, RegistrationSaved(w, x, slope, seen)


def registration_reverse(d_residual: FloatArray, saved: RegistrationSaved) -> RegistrationGrads:
    """Reverse of equation (B19).

    d_residual  (M,)  derivative of the loss with respect to the residuals
    returns     the derivatives with respect to pose, points and reference, float64
    """
    g = saved.slope * d_residual
    return RegistrationGrads(
        g @ saved.points.T, g.sum(axis=1), saved.rotation.T @ g, np.where(saved.seen, -np.asarray(d_residual), 0.0)
    )
