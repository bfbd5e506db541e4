"""Trajectories: the poses of a file, and which of them belongs to which frame. `trajectory_lines` reads the lines.

The stamp is a time or a frame number. In: the file, its unit, direction and axes. Out: one world-to-camera
pose per frame in millimetres or the arbitrary unit; None for frames without a pose.
"""

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.camera import pose_of, scene_factor
from endotsr.clips.formats.trajectory_lines import StoredPose, stored_poses
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.names import counted

# Seconds per step of a stamp, by the least stamp that has this unit: no recording is older than 1973 or begins in 5138.
TICKS = (
    (1e17, 1e-9, "nanoseconds"),
    (1e14, 1e-6, "microseconds"),
    (1e11, 1e-3, "milliseconds"),
    (-np.inf, 1.0, "seconds"),
)
USUAL_UNIT = "m"  # of the positions, without an option


class Trajectory(NamedTuple):
    """Poses by stamp, ascending."""

    stamps: NDArray[np.float64]  # (n,)
    poses: list[CameraPose]  # world-to-camera, OpenCV axes
    path: Path
    stamped: bool = True  # False: the file holds one pose per frame, in order
    notes: tuple[str, ...] = ()  # on the columns

    @property
    def counts_frames(self) -> bool:
        """Whether every stamp is a non-negative integer, like a frame number."""
        return bool((self.stamps == np.rint(self.stamps)).all() and self.stamps[0] >= 0)

    @property
    def tick(self) -> tuple[float, str]:
        """Seconds per step of a stamp that is a time, and the unit in words."""
        return next((step, name) for least, step, name in TICKS if self.stamps[0] >= least)

    def in_seconds(self) -> "Trajectory":
        """The trajectory with stamps in seconds."""
        return self._replace(stamps=self.stamps * self.tick[0])


def read_trajectory(path: Path, unit: str, direction: str = "camera_to_world", axes: str = "opencv") -> Trajectory:
    """The poses of a file.

    unit        of the positions: um, mm, cm, m or arbitrary
    direction   camera_to_world (positions of the camera) or world_to_camera
    axes        of the camera, a key of `AXES`

    Raises:  InputError naming the line and the reason.
    """
    rows, stamped, notes, stated = stored_poses(Path(path))
    if stated not in ("", unit) and unit == USUAL_UNIT:  # another one was stated with the command
        raise InputError(
            f"{path}: its head line states positions in {stated}, and they are read in {unit}; use"
            f" --trajectory-unit {stated}"
        )
    descends = next((row.where for before, row in pairwise(rows) if row.stamp < before.stamp), "")
    if descends:
        notes = [*notes, f"{descends.removeprefix(f'{path}: ')}: stamps go back: the poses are sorted by their stamps"]
    rows.sort(key=lambda row: row.stamp)
    for before, row in pairwise(rows):
        if before.stamp == row.stamp:
            raise InputError(f"{row.where}: the stamp {row.stamp:.12g} occurs twice")
    if len(rows) > 1 and all(_same_pose(rows[0], row) for row in rows):
        notes = [*notes, f"all {len(rows)} poses are the same: the camera is read as one that stands still"]
    scale = scene_factor(unit)
    poses = [pose_of(row.rotation, row.position * scale, direction, axes, row.where) for row in rows]
    return Trajectory(np.array([row.stamp for row in rows], np.float64), poses, Path(path), stamped, tuple(notes))


def _same_pose(one: StoredPose, other: StoredPose) -> bool:
    """Whether two poses differ by no more than rounding."""
    return bool(
        np.allclose(one.rotation, other.rotation, 0, 1e-9) and np.allclose(one.position, other.position, 0, 1e-9)
    )


def poses_of_frames(
    trajectory: Trajectory,
    count: int,
    rate: float | None,
    times: FloatArray | None = None,
    numbers: list[int] | None = None,
    clock: FloatArray | None = None,
) -> tuple[list[CameraPose | None], str]:
    """One pose per frame, None without one, and a sentence on the assignment of stamps to frames.

    times     seconds of the frames from the first one; None: evenly spaced at `rate`
    numbers   in the names of the frames
    clock     seconds of the frames, on a clock that the trajectory may share; None: unknown

    Integer stamps that are all numbers of frames belong to these, and so do those of a file that has all of them, where
    the rate is unknown. Integer stamps below the number of frames are frame numbers. Stamps within the clock of the
    frames belong to it. If there are as many poses as frames, they match in order. Other stamps are seconds from the
    first one. Poses between stamps are interpolated.

    Raises:  InputError if the stamps are times and the frame rate is unknown.
    """
    stamps = trajectory.stamps
    if not trajectory.stamped and len(stamps) != count:
        raise InputError(
            f"{trajectory.path}: {len(stamps)} poses without stamps for {counted(count, 'frame')}; use one pose"
            " per frame"
        )
    if (named := _by_numbers(trajectory, numbers, rate)) is not None:
        return named, "stamps are the numbers in the names of the frames"
    if trajectory.counts_frames and stamps[-1] < count:
        found: list[CameraPose | None] = [None] * count
        for stamp, pose in zip(stamps, trajectory.poses):
            found[int(stamp)] = pose
        return found, "stamps are frame numbers"
    timed = trajectory.in_seconds()
    if clock is not None and rate and _overlap(timed.stamps, clock):
        return poses_at(timed, clock, 1.0 / rate), f"stamps are {trajectory.tick[1]} on the clock of the pictures"
    if len(stamps) == count:
        return list(trajectory.poses), "one pose per frame, in order"
    if rate is None:
        raise InputError(
            f"{trajectory.path}: {len(stamps)} poses with times for {counted(count, 'frame')}; use one pose per"
            " frame, frame numbers as stamps, or a known frame rate"
        )
    wanted = timed.stamps[0] + (np.arange(count) / rate if times is None else times)
    how = f"stamps are {trajectory.tick[1]}; frames at {rate:g} Hz from the first one"
    return poses_at(timed, wanted, 1.0 / rate), how


def _overlap(a: FloatArray, b: FloatArray) -> bool:
    """Whether two ascending series have times in common."""
    return bool(a[0] <= b[-1] and b[0] <= a[-1])


def _by_numbers(
    trajectory: Trajectory, numbers: list[int] | None, rate: float | None
) -> list[CameraPose | None] | None:
    """The poses whose stamps are the numbers of frames; None unless all stamps are, or, without a rate, all frames."""
    if numbers is None or not trajectory.counts_frames or not trajectory.stamped or numbers == [*range(len(numbers))]:
        return None
    by_stamp = dict(zip(trajectory.stamps.tolist(), trajectory.poses))
    wanted = [float(number) for number in numbers]  # nanoseconds have more digits than a float64
    if not (set(by_stamp) <= set(wanted) or (rate is None and set(wanted) <= set(by_stamp))):
        return None
    return [by_stamp.get(number) for number in wanted]


def poses_at(trajectory: Trajectory, times: FloatArray, longest: float) -> list[CameraPose | None]:
    """Poses at times, interpolated between stamps that are at most 2 `longest` apart, seconds.

    Edges:   elsewhere the nearest pose if it is at most `longest` / 2 away, else None.
    """
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


def filled(poses: list[CameraPose | None], times: FloatArray | None = None) -> list[CameraPose]:
    """The poses with gaps interpolated; before the first and after the last pose, the nearest one.

    times   (n,) seconds of the frames; None: evenly spaced
    """
    times = np.arange(len(poses), dtype=np.float64) if times is None else times
    known = [i for i, pose in enumerate(poses) if pose is not None]
    found = []
    for i, pose in enumerate(poses):
        if pose is None:
            before = max((k for k in known if k < i), default=None)
            after = min((k for k in known if k > i), default=None)
            ends = [poses[k] for k in (before, after) if k is not None]
            if before is not None and after is not None and ends[0] and ends[1]:
                passed, whole = times[i] - times[before], times[after] - times[before]
                pose = pose_between(ends[0], ends[1], float(passed / whole))
            else:
                pose = ends[0]
        assert pose is not None
        found.append(pose)
    return found
