"""Cameras as files state them: intrinsics in pixels, and poses in any direction and axes.

Conventions: pixel edges are at integers (the first pixel centre is at 0.5), and a `CameraPose` is world-to-camera in
OpenCV axes. `pose_of` and `camera_to_world` are the only conversions between the axes of different programs.
"""

from typing import NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}
ARBITRARY = "arbitrary"
LARGEST_SIDE = 1 << 16  # pixels of a stated picture
LEAST_VIEW, MOST_VIEW = 5, 170  # degrees, of `--field-of-view`
SPREAD = 0.003  # of the focal length: 1 px at the border of a picture of 640 px; of the picture; of a coefficient
ROTATION_TOLERANCE = 1e-3  # largest entry of R^T R - 1 accepted for a rotation written with few digits
ROTATIONS = "use the matrix of a rotation, of determinant 1"
# x right, y down, z forward; x right, y up, z backward; x down, y right, z backward. x_opencv = AXES[name] @ x_name.
AXES = {
    "opencv": np.eye(3),
    "opengl": np.diag([1.0, -1.0, -1.0]),
    "llff": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
}


def scene_factor(unit: str) -> float:
    """The factor from lengths in `unit` to scene units: millimetres, or the arbitrary unit itself."""
    return 1.0 if unit == ARBITRARY else MILLIMETRES[unit]


class Intrinsics(NamedTuple):
    """Intrinsics of one camera, pixels; pixel edges at integers."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: tuple[float, ...] = ()  # OpenCV's order k1 k2 p1 p2 [k3 [k4 k5 k6]]; empty: none

    def scaled(self, width: int, height: int) -> "Intrinsics":
        """The intrinsics of the picture resized to width x height, with aligned picture edges."""
        x, y = width / self.width, height / self.height
        return self._replace(fx=self.fx * x, cx=self.cx * x, fy=self.fy * y, cy=self.cy * y, width=width, height=height)


def focal_length(angle: float, side: int) -> float:
    """Focal length in pixels of a view with this angle, radians, across `side` pixels."""
    return side / 2 / np.tan(angle / 2)


def intrinsics_of_view(degrees: float, width: int, height: int) -> Intrinsics:
    """Square pixels and a centred principal point: f = (width / 2) / tan(angle / 2), with the horizontal angle.

    Raises:  InputError for an angle outside 5 to 170 degrees, such as one in radians; a picture of a pinhole camera has
             no 180.
    """
    if not LEAST_VIEW <= degrees <= MOST_VIEW:
        radians = f"; {degrees:g} radians are {np.degrees(degrees):.1f} degrees" if 0 < degrees < np.pi else ""
        allowed = f"use the horizontal angle, {LEAST_VIEW} to {MOST_VIEW} degrees"
        raise InputError(f"--field-of-view {degrees:g}: {allowed}{radians}")
    focal = focal_length(np.radians(degrees), width)
    return Intrinsics(focal, focal, width / 2, height / 2, width, height)


class StereoCalibration(NamedTuple):
    """Two cameras before rectification: x_right = rotation @ x_left + translation."""

    left: Intrinsics
    right: Intrinsics
    rotation: FloatArray  # (3, 3)
    translation: FloatArray  # (3,) millimetres


def pose_of(
    rotation: FloatArray, translation: FloatArray, direction: str, axes: str = "opencv", where: object = "pose"
) -> CameraPose:
    """The pose that a file states.

    rotation, translation   (3, 3), (3,) x_to = rotation @ x_from + translation
    direction   `camera_to_world` or `world_to_camera`
    axes        of the camera, a key of `AXES`

    Raises:  InputError unless the rotation is one, and the translation is finite.
    """
    if axes != "opencv":
        flip = AXES[axes]
        if direction == "world_to_camera":
            rotation, translation = flip @ rotation, flip @ translation
        else:
            rotation = rotation @ flip.T
    rotation = checked_rotation(rotation, where)
    if not np.isfinite(translation).all():
        raise InputError(f"{where}: the translation is not finite")
    return inverse_pose(rotation, translation) if direction == "camera_to_world" else CameraPose(rotation, translation)


def camera_to_world(pose: CameraPose, axes: str = "opencv") -> tuple[FloatArray, FloatArray]:
    """Rotation and centre of a pose for a program with other axes, the inverse of `pose_of`."""
    rotation, centre = inverse_pose(*pose)
    return rotation if axes == "opencv" else rotation @ AXES[axes], centre


def inverse_pose(rotation: FloatArray, translation: FloatArray) -> CameraPose:
    """World-to-camera from camera-to-world, or the reverse."""
    turned = np.ascontiguousarray(rotation.T)
    return CameraPose(turned, -turned @ translation + 0.0)


def rows_of_motion(matrix: FloatArray, where: object) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and translation (3,) of a matrix of 3x4 or 4x4.

    Raises:  InputError for a last row other than 0 0 0 1, in which a transposed matrix has its translation.
    """
    if len(matrix) == 4 and (matrix[3] != (0, 0, 0, 1)).any():
        last = " ".join(f"{value:g}" for value in matrix[3])
        raise InputError(f"{where}: the last row of the matrix is {last}; use 0 0 0 1: is the matrix transposed?")
    return matrix[:3, :3], matrix[:3, 3]


def checked_rotation(matrix: FloatArray, where: object) -> FloatArray:
    """The matrix. Raises InputError unless it is a finite rotation."""
    if not np.isfinite(matrix).all():
        raise InputError(f"{where}: the rotation is not finite; {ROTATIONS}")
    if np.abs(matrix.T @ matrix - np.eye(3)).max() > ROTATION_TOLERANCE:
        raise InputError(f"{where}: the first three columns are not perpendicular unit vectors; {ROTATIONS}")
    if np.linalg.det(matrix) < 0:
        raise InputError(f"{where}: the first three columns are a mirror image, not a rotation; {ROTATIONS}")
    return np.ascontiguousarray(matrix)


def intrinsics_of_matrix(
    matrix: FloatArray, width: int, height: int, distortion: tuple[float, ...] = (), *, where: object
) -> Intrinsics:
    """The intrinsics of a 3x3 matrix in OpenCV's convention, with pixel centres at integers: half a pixel is added.

    Raises:  InputError for a matrix that is not finite, is transposed or has skew, and as `checked_intrinsics`.
    """
    numbers = np.asarray(matrix, np.float64)
    if numbers.shape != (3, 3) or not np.isfinite(numbers).all():
        raise InputError(f"{where}: camera matrix: use 3x3 finite numbers")
    if (numbers[2] != (0, 0, 1)).any() or numbers[1, 0] != 0:
        last = " ".join(f"{value:g}" for value in numbers[2])
        raise InputError(f"{where}: camera matrix: the last row is {last}; use 0 0 1: is the matrix transposed?")
    if numbers[0, 1] != 0:
        raise InputError(f"{where}: camera matrix: skew {numbers[0, 1]:g}; use 0 (square angles)")
    fx, fy, cx, cy = (
        float(value) for value in (numbers[0, 0], numbers[1, 1], numbers[0, 2] + 0.5, numbers[1, 2] + 0.5)
    )
    return checked_intrinsics(Intrinsics(fx, fy, cx, cy, width, height, distortion), where)


def checked_intrinsics(found: Intrinsics, where: object) -> Intrinsics:
    """The intrinsics, checked.

    Raises:  InputError for values that are not finite, a focal length that is not positive, a picture that no file has,
             a principal point far outside the picture, or another number of distortion coefficients than 0, 4, 5 or 8.
    """
    fx, fy, cx, cy, width, height, distortion = found
    if max(width, height) > LARGEST_SIDE:
        raise InputError(f"{where}: states a picture of more than {LARGEST_SIDE} pixels on a side; state its true size")
    if not np.isfinite([fx, fy, cx, cy, *distortion]).all():
        raise InputError(f"{where}: camera: use finite numbers, got {found[:4]} and distortion {distortion}")
    if fx <= 0 or fy <= 0:
        raise InputError(f"{where}: focal length {min(fx, fy):g}: use numbers > 0")
    if not -width <= cx <= 2 * width or not -height <= cy <= 2 * height:
        raise InputError(
            f"{where}: principal point ({cx:g}, {cy:g}) is far outside the {width}x{height} pixels; is the calibration"
            " of another picture size?"
        )
    if len(distortion) not in (0, 4, 5, 8):
        raise InputError(f"{where}: {len(distortion)} distortion coefficients; use none, 4, 5 or 8")
    return found


def opencv_matrix(intrinsics: Intrinsics) -> FloatArray:
    """The 3x3 matrix in OpenCV's convention (pixel centres at integers)."""
    fx, fy, cx, cy, *_ = intrinsics
    return np.array([[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]])


def shared_intrinsics(cameras: list[Intrinsics], where: object, notes: list[str]) -> Intrinsics:
    """The median of the cameras of single pictures, which a reconstruction estimates one by one; noted if they differ.

    Raises:  InputError for several picture sizes, or focal lengths (relative), principal points (over width and height)
             or distortion coefficients that differ from their median by more than `SPREAD`.
    """
    if len(set(cameras)) == 1:
        return cameras[0]
    if len({(c.width, c.height, len(c.distortion)) for c in cameras}) > 1:
        raise InputError(f"{where}: {len(set(cameras))} cameras of different kinds or sizes; use one for all frames")
    rows = np.array([[*c[:4], *c.distortion] for c in cameras])
    middle = np.median(rows, axis=0)
    apart = np.abs(rows[:, :4] - middle[:4]).max(axis=0) / (middle[0], middle[1], cameras[0].width, cameras[0].height)
    if apart.max() > SPREAD or np.abs(rows[:, 4:] - middle[4:]).max(initial=0.0) > SPREAD:
        raise InputError(
            f"{where}: the cameras of the pictures differ by {apart.max():.2%}, more than {SPREAD:.1%}; use one camera"
            " for all frames (COLMAP: --ImageReader.single_camera 1)"
        )
    notes.append(f"one camera per picture, which differ by {apart.max():.2%} at most: their median is used")
    fx, fy, cx, cy, *bent = middle.tolist()
    return Intrinsics(fx, fy, cx, cy, cameras[0].width, cameras[0].height, tuple(bent))
