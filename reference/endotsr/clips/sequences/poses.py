"""Conversion between LLFF pose files and cameras.

A row is a row-major 3x5 matrix and two bounds: [R | t | (H, W, f)], near, far. The columns of R are camera-to-world
axes with x right, y up, z backward. They become OpenCV axes as [c0, -c1, -c2], as in published loaders of this format;
for identical static poses, any rotation is only a choice of world axes. Both axes have one focal length, and the
principal point is the image centre, (W/2, H/2) with pixel edges at integers.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.depth_files import read_npy
from endotsr.clips.sequences.sequence_file import checked_rotation
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, camera_centre

POSE_FILES = ("poses_bounds.npy", "pose_bounds.npy")
LARGEST_POSES = 1 << 26  # bytes: half a million frames
ALLOWED_POSES = "allowed: an .npy file of numbers, (frames, 17)"
FLIP = np.array([1.0, -1.0, -1.0])  # LLFF axes to OpenCV axes, and back
STATIC_TOLERANCE = 1e-9  # ruling: a camera moves if a pose entry varies by more


def find_pose_file(folder: Path) -> Path:
    """The pose file of a sequence folder. Raises InputError if there is none."""
    for name in POSE_FILES:
        if (folder / name).is_file():
            return folder / name
    raise InputError(f"{folder / POSE_FILES[0]}: file not found")


def read_pose_rows(path: Path, count: int) -> NDArray[np.float64]:
    """The rows of a pose file, (count, 17) finite numbers.

    Raises:  InputError naming the file, the frame (row) and the reason. Pickled objects are never loaded.
    """
    rows = read_npy(path, LARGEST_POSES, ALLOWED_POSES)
    if rows.ndim != 2 or rows.shape[1] != 17:
        raise InputError(f"{path}: shape {rows.shape}, expected (frames, 17)")
    if len(rows) != count:
        raise InputError(f"{path}: {len(rows)} poses for {count} images")
    rows = rows.astype(np.float64)
    broken = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if broken.size:
        column = int(np.flatnonzero(~np.isfinite(rows[broken[0]]))[0])
        raise InputError(f"{path}: frame {broken[0]}: value {column} of the row is {rows[broken[0], column]}")
    return rows


def cameras_from_rows(rows: NDArray[np.float64], width: int, height: int, path: Path, frames: range) -> list[Camera]:
    """Cameras of the chosen rows; the same object for all frames of a static camera.

    rows    (n, 17) rows of the pose file
    width, height  size of the image files, pixels
    path, frames   for messages; `frames` also selects the rows

    Raises:  InputError if a row has another image size, a focal length that is not positive, or an invalid rotation.
    """
    cameras = [_camera(rows[i], width, height, f"{path}: frame {i}") for i in frames]
    chosen = rows[list(frames)][:, :15]
    static = bool((np.ptp(chosen, axis=0) <= STATIC_TOLERANCE).all())
    return [cameras[0]] * len(cameras) if static else cameras


def _camera(row: NDArray[np.float64], width: int, height: int, where: str) -> Camera:
    matrix = row[:15].reshape(3, 5)
    stated_height, stated_width, focal = matrix[:, 4]
    if (stated_width, stated_height) != (width, height):
        hint = "; height and width look swapped" if (stated_width, stated_height) == (height, width) else ""
        raise InputError(
            f"{where}: states an image of {stated_width:g}x{stated_height:g},"
            f" the image files are {width}x{height}{hint}"
        )
    if focal <= 0:
        raise InputError(f"{where}: focal length {focal:g}, must be positive")
    axes = matrix[:, :3] * FLIP  # camera-to-world, OpenCV axes
    rotation = np.ascontiguousarray(checked_rotation(axes, where).T) + 0.0  # + 0 turns -0 into 0
    return Camera(
        rotation, -rotation @ matrix[:, 3] + 0.0, float(focal), float(focal), width / 2, height / 2, width, height
    )


def rows_from_cameras(cameras: list[Camera], far: NDArray[np.floating]) -> NDArray[np.float64]:
    """Pose rows (n, 17) of cameras, with bounds 0 and `far` (n,). The inverse of `cameras_from_rows`.

    Raises:  InputError for a camera outside the format (two focal lengths, principal point off centre).
    """
    rows = np.zeros((len(cameras), 17))
    for i, camera in enumerate(cameras):
        centred = np.allclose((camera.cx, camera.cy), (camera.width / 2, camera.height / 2), rtol=0, atol=1e-9)
        if camera.fx != camera.fy or not centred:
            raise InputError(
                f"frame {i}: a pose file holds one focal length and a central principal point only;"
                f" got fx {camera.fx:g}, fy {camera.fy:g}, cx {camera.cx:g}, cy {camera.cy:g}"
            )
        matrix = np.column_stack(
            [camera.rotation.T * FLIP, camera_centre(camera), [camera.height, camera.width, camera.fx]]
        )
        rows[i, :15] = matrix.ravel()
        rows[i, 16] = far[i]
    return rows
