"""Conversion between LLFF pose files and cameras.

A row is a row-major 3x5 matrix and two bounds: [R | t | (H, W, f)], near, far. The columns of R are camera-to-world
axes. Published loaders of endoscopic clips take them as x right, y up, z backward, which is the default here; LLFF's
own tool writes down, right, backward. For identical static poses, any rotation is only a choice of world axes. Both
axes have one focal length, and the principal point is the image centre, (W/2, H/2) with pixel edges at integers.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import AXES, Intrinsics, pose_of, scene_factor
from endotsr.clips.formats.plain_arrays import read_npy
from endotsr.clips.sequences.clip import REST, rests
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, CameraPose, camera_centre
from endotsr.untrusted.names import counted

POSE_FILES = ("poses_bounds.npy", "pose_bounds.npy")
LARGEST_POSES = 1 << 26  # bytes: half a million frames
ALLOWED_POSES = "use an .npy file of numbers, (frames, 17)"
FLIP = np.diag(AXES["opengl"])
SAME_FOCAL = 1e-6  # relative difference of two equal focal lengths


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
        raise InputError(f"{path}: {counted(len(rows), 'pose')} for {counted(count, 'image')}; use one row per image")
    rows = rows.astype(np.float64)
    broken = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if broken.size:
        column = int(np.flatnonzero(~np.isfinite(rows[broken[0]]))[0])
        raise InputError(
            f"{path}: frame {broken[0]}: value {column} of the row is {rows[broken[0], column]}; use finite numbers"
        )
    return rows


class RowCameras(NamedTuple):
    """What the rows state: the fields of a `Clip` with these names."""

    intrinsics: Intrinsics | None
    poses: list[CameraPose | None] | None  # None: a static camera
    rest: CameraPose  # the pose of a static camera
    pose_faults: dict[int, str]


class RowConvention(NamedTuple):
    """What the numbers of a row mean."""

    axes: str = "opengl"  # of the camera, a key of `AXES`
    direction: str = "camera_to_world"
    unit: str = "mm"  # of the positions


OF_CLIPS = RowConvention()  # as published loaders of endoscopic clips read them


def cameras_of_rows(
    rows: NDArray[np.float64], width: int, height: int, path: Path, convention: RowConvention = OF_CLIPS
) -> RowCameras:
    """The cameras of the rows (n, 17).

    width, height  size of the image files, pixels
    path           for messages

    A frame has a fault if its row has another image size or focal length than the others, a focal length that is not
    positive, or an invalid rotation.
    """
    focal = next((float(row[14]) for row in rows if row[14] > 0), 0.0)
    poses: list[CameraPose | None] = []
    faults = {}
    for i, row in enumerate(rows):
        try:
            poses.append(_pose(row, (width, height, focal), f"{path}: frame {i}", convention))
        except InputError as error:
            poses.append(None)
            faults[i] = str(error)
    intrinsics = Intrinsics(focal, focal, width / 2, height / 2, width, height) if focal else None
    known = [pose for pose in poses if pose is not None]
    if faults or not rests(known):
        return RowCameras(intrinsics, poses, REST, faults)
    return RowCameras(intrinsics, None, known[0], {})


def _pose(
    row: NDArray[np.float64], camera: tuple[int, int, float], where: str, convention: RowConvention
) -> CameraPose:
    width, height, usual = camera
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
    if abs(focal - usual) > SAME_FOCAL * usual:
        raise InputError(f"{where}: focal length {focal:g}, of the first frame {usual:g}; use one for all frames")
    shift = matrix[:, 3] * scene_factor(convention.unit)
    pose = pose_of(matrix[:, :3], shift, convention.direction, convention.axes, where)
    return pose._replace(rotation=pose.rotation + 0.0)  # + 0 turns -0 into 0


def rows_from_cameras(cameras: list[Camera], far: NDArray[np.floating]) -> NDArray[np.float64]:
    """Pose rows (n, 17) of cameras, with bounds 0 and `far` (n,). The inverse of `cameras_of_rows`.

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
