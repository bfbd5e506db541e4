"""Trajectories: one line per pose, `stamp tx ty tz qx qy qz qw` of TUM and EuRoC, or the matrices of KITTI; or .npy.

Lines that begin with # are comments; a head line may state the order of the quaternion. Matrices have no stamps: one
per frame, in order.

The stamp is a time in seconds or a frame number. In: the file, its unit, direction and axes. Out: one world-to-camera
pose per frame in millimetres or the arbitrary unit; None for frames without a pose.
"""

import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.camera import pose_of, scene_factor
from endotsr.clips.sequences.depth_files import read_npy
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.files import read_text

COLUMNS = (7, 8, 12, 16)
ALLOWED = (
    "allowed: 8 finite numbers, stamp tx ty tz qx qy qz qw; without stamps 7, or the 12 or 16 of a matrix, as KITTI has"
    " them"
)
NORM_TOLERANCE = 1e-2  # of a quaternion written with few digits


class Trajectory(NamedTuple):
    """Poses by stamp, ascending."""

    stamps: NDArray[np.float64]  # (n,)
    poses: list[CameraPose]  # world-to-camera, OpenCV axes
    path: Path
    stamped: bool = True  # False: the file holds one pose per frame, in order

    @property
    def counts_frames(self) -> bool:
        """Whether every stamp is a non-negative integer, like a frame number."""
        return bool((self.stamps == np.rint(self.stamps)).all() and self.stamps[0] >= 0)


def read_trajectory(path: Path, unit: str, direction: str = "camera_to_world", axes: str = "opencv") -> Trajectory:
    """The poses of a file.

    unit        of the positions: um, mm, cm, m or arbitrary
    direction   camera_to_world (positions of the camera) or world_to_camera
    axes        of the camera, a key of `AXES`

    Raises:  InputError naming the line and the reason.
    """
    rows, stamped = _stored(Path(path))
    rows.sort(key=lambda row: row.stamp)
    for before, row in pairwise(rows):
        if before.stamp == row.stamp:
            raise InputError(f"{row.where}: the stamp {row.stamp:.12g} occurs twice")
    scale = scene_factor(unit)
    poses = [pose_of(row.rotation, row.position * scale, direction, axes, row.where) for row in rows]
    return Trajectory(np.array([row.stamp for row in rows], np.float64), poses, Path(path), stamped)


class _Row(NamedTuple):
    """A pose as it is stored."""

    stamp: float
    rotation: FloatArray  # (3, 3)
    position: FloatArray  # (3,)
    where: str


def _stored(path: Path) -> tuple[list[_Row], bool]:
    """The poses of a file, and whether they have stamps; without, they count from 0. Raises InputError."""
    lines = _array_lines(path) if path.suffix.lower() == ".npy" else _text_lines(path)
    if not lines:
        raise InputError(f"{path}: holds no pose; {ALLOWED}")
    found, order = [], "xyzw"
    sizes = {len(row) for _, row, _ in lines}
    if len(sizes) > 1:
        raise InputError(f"{path}: lines of {' and '.join(map(str, sorted(sizes)))} numbers; {ALLOWED}")
    for k, (where, row, stated) in enumerate(lines):
        order = stated or order
        if len(row) in (12, 16):
            matrix = np.array(row).reshape(-1, 4)[:3]
            found.append(_Row(k, matrix[:, :3], matrix[:, 3], where))
        else:
            stamp, *rest = row if len(row) == 8 else [float(k), *row]
            found.append(_Row(stamp, _rotation(rest[3:], order, where), np.array(rest[:3]), where))
    return found, sizes == {8}


def _array_lines(path: Path) -> list[tuple[str, list[float], str]]:
    """The rows of an array (n, 7 | 8 | 12 | 16), (n, 3, 4) or (n, 4, 4), with their place."""
    array = read_npy(path).astype(np.float64)
    rows = array.reshape(len(array), -1) if array.ndim in (2, 3) and len(array) else np.zeros((0, 0))
    if rows.shape[1] not in COLUMNS or not np.isfinite(rows).all():
        raise InputError(f"{path}: array of shape {array.shape}; {ALLOWED}")
    return [(f"{path}: row {i}", row, "") for i, row in enumerate(rows.tolist())]


def _text_lines(path: Path) -> list[tuple[str, list[float], str]]:
    """Place, numbers and stated order of the quaternion of every line; a head line may have no mark."""
    found, order = [], ""
    for number, line in enumerate(read_text(path).splitlines(), 1):
        words, where = line.replace(",", " ").split(), f"{path}: line {number}"
        if not words or words[0].startswith("#"):
            order = _stated_order(line) or order
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if not row and not found and _stated_order(line):
            order = _stated_order(line)
            continue
        if len(row) not in COLUMNS or not np.isfinite(row).all():
            raise InputError(f"{where}: {ALLOWED}")
        found.append((where, row, order))
    return found


def _rotation(quaternion: list[float], order: str, where: str) -> FloatArray:
    from scipy.spatial.transform import Rotation

    length = np.linalg.norm(quaternion)
    if abs(length - 1) > NORM_TOLERANCE:
        raise InputError(f"{where}: the quaternion has length {length:.4g}; allowed: 1, in the order x y z w")
    return Rotation.from_quat([quaternion[order.index(axis)] for axis in "xyzw"]).as_matrix()


def _stated_order(line: str) -> str:
    """The order of the quaternion that a head line states, such as `q_w, q_x, q_y, q_z`; "" without one."""
    found = re.findall(r"\bq\w*?_?([wxyz])\b", line)
    return "".join(found) if sorted(found) == list("wxyz") else ""


def poses_of_frames(
    trajectory: Trajectory,
    count: int,
    rate: float | None,
    times: FloatArray | None = None,
    numbers: list[int] | None = None,
) -> tuple[list[CameraPose | None], str]:
    """One pose per frame, None without one, and a sentence on the assignment of stamps to frames.

    times     seconds of the frames from the first one; None: evenly spaced at `rate`
    numbers   in the names of the frames

    Integer stamps that are all numbers of frames belong to these, and so do those of a file that has all of them, where
    the rate is unknown. Integer stamps below the number of frames are frame numbers. If there are as many poses as
    frames, they match in order. Other stamps are seconds from the first one, and poses between stamps are interpolated.

    Raises:  InputError if the stamps are times and the frame rate is unknown.
    """
    stamps = trajectory.stamps
    if not trajectory.stamped and len(stamps) != count:
        raise InputError(
            f"{trajectory.path}: {len(stamps)} poses without stamps for {count} frames; allowed: one pose per frame"
        )
    if (named := _by_numbers(trajectory, numbers, rate)) is not None:
        return named, "stamps are the numbers in the names of the frames"
    if trajectory.counts_frames and stamps[-1] < count:
        found: list[CameraPose | None] = [None] * count
        for stamp, pose in zip(stamps, trajectory.poses):
            found[int(stamp)] = pose
        return found, "stamps are frame numbers"
    if len(stamps) == count:
        return list(trajectory.poses), "one pose per frame, in order"
    if rate is None:
        raise InputError(
            f"{trajectory.path}: {len(stamps)} poses with times for {count} frames; allowed: one pose per frame, frame"
            " numbers as stamps, or a known frame rate"
        )
    wanted = stamps[0] + (np.arange(count) / rate if times is None else times)
    return poses_at(trajectory, wanted, 1.0 / rate), f"stamps are seconds; frames at {rate:g} Hz from the first one"


def _by_numbers(
    trajectory: Trajectory, numbers: list[int] | None, rate: float | None
) -> list[CameraPose | None] | None:
    """The poses whose stamps are the numbers of frames; None unless all stamps are, or, without a rate, all frames."""
    if numbers is None or not trajectory.counts_frames or not trajectory.stamped or numbers == [*range(len(numbers))]:
        return None
    by_stamp = {int(stamp): pose for stamp, pose in zip(trajectory.stamps, trajectory.poses)}
    if not (set(by_stamp) <= set(numbers) or (rate is None and set(numbers) <= set(by_stamp))):
        return None
    return [by_stamp.get(number) for number in numbers]


def poses_at(trajectory: Trajectory, times: FloatArray, longest: float) -> list[CameraPose | None]:
    """Poses at times, interpolated; None outside the trajectory and in gaps longer than 2 `longest`, seconds."""
    stamps, found = trajectory.stamps, []
    for t in times:
        after = int(np.searchsorted(stamps, t))
        nearest = min((k for k in (after - 1, after) if 0 <= k < len(stamps)), key=lambda k: abs(stamps[k] - t))
        if abs(stamps[nearest] - t) <= 1e-3 * longest:
            found.append(trajectory.poses[nearest])
        elif 0 < after < len(stamps) and stamps[after] - stamps[after - 1] <= 2 * longest:
            fraction = (t - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
            found.append(pose_between(trajectory.poses[after - 1], trajectory.poses[after], fraction))
        else:
            found.append(trajectory.poses[nearest] if abs(stamps[nearest] - t) <= longest / 2 else None)
    return found


def pose_between(a: CameraPose, b: CameraPose, fraction: float) -> CameraPose:
    """The interpolated pose: the centre on the straight line, the rotation on the shortest arc."""
    from scipy.spatial.transform import Rotation, Slerp

    centres = [-pose.rotation.T @ pose.translation for pose in (a, b)]
    rotation = Slerp([0.0, 1.0], Rotation.from_matrix([a.rotation, b.rotation]))(fraction).as_matrix()
    return CameraPose(rotation, -rotation @ (centres[0] + fraction * (centres[1] - centres[0])))


def filled(poses: list[CameraPose | None]) -> list[CameraPose]:
    """The poses with gaps interpolated; before the first and after the last pose, the nearest one."""
    known = [i for i, pose in enumerate(poses) if pose is not None]
    found = []
    for i, pose in enumerate(poses):
        if pose is None:
            before = max((k for k in known if k < i), default=None)
            after = min((k for k in known if k > i), default=None)
            ends = [poses[k] for k in (before, after) if k is not None]
            if before is not None and after is not None and ends[0] and ends[1]:
                pose = pose_between(ends[0], ends[1], (i - before) / (after - before))
            else:
                pose = ends[0]
        assert pose is not None
        found.append(pose)
    return found
