"""EuRoC: the folder `mav0/` of a recording with cameras on a rigid body, as ETH Zurich publishes it.

cam0/data.csv, cam0/data/                  nanoseconds,file: the left pictures
cam0/sensor.yaml                           intrinsics; T_BS, from the camera to the body, metres
cam1/                                      the right camera, likewise (optional)
state_groundtruth_estimate0/data.csv       nanoseconds and poses of a sensor, sensor to world, metres (optional)
state_groundtruth_estimate0/sensor.yaml    T_BS of that sensor (optional; without it, the sensor is the body)

All stamps share one clock. The pose of a camera is the pose of the body times T_BS.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.clips.formats.calibration_formats import HALF_A_PIXEL
from endotsr.clips.formats.calibrations import StatedCamera, calibrated
from endotsr.clips.formats.camera import StereoCalibration, checked_rotation, inverse_pose, rows_of_motion
from endotsr.clips.formats.files import shortened, visible_files
from endotsr.clips.formats.picture_fields import picture_notes
from endotsr.clips.formats.time_lists import TimedFile, nanosecond_list
from endotsr.clips.formats.trajectory import USUAL_UNIT, poses_at, read_trajectory
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import (
    pictures_from_files,
    size_of,
    stated_camera,
    stated_depth,
    stated_masks,
    unit_of,
)
from endotsr.clips.sequences.times import usual_rate
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.yaml import matrix, read_yaml

BODY, CAMERAS, LIST, SENSOR = "mav0", ("cam0", "cam1"), "data.csv", "sensor.yaml"
TRUTH = "state_groundtruth_estimate0"
LONGEST = 0.02  # seconds between a picture and its pose
PAIRED = 1_000_000  # nanoseconds between the pictures of a pair; the cameras are triggered together
READS = ("cam0", "cam1", "body.yaml")  # body.yaml holds a comment


class Mount(NamedTuple):
    """T_BS: x_body = rotation @ x_sensor + shift, metres."""

    rotation: np.ndarray
    shift: np.ndarray


def _body(path: Path) -> Path:
    return path / BODY if (path / BODY).is_dir() else path


def recognises(path: Path) -> bool:
    """Whether a path is `mav0`, or a folder with it."""
    return (_body(path) / CAMERAS[0] / LIST).is_file()


def mount(path: Path, otherwise: Mount | None = None) -> Mount:
    """T_BS of a sensor.yaml, or `otherwise` without the file. Raises InputError for a matrix that is no motion."""
    if otherwise is not None and not path.is_file():
        return otherwise
    where = f"{path}: T_BS"
    stored = read_yaml(path).get("T_BS") if path.is_file() else None
    if stored is None:
        raise InputError(
            f"{where} is missing; it relates the camera to the body: state it, or --calibration FILE of the cameras"
            " and --trajectory FILE with poses of the camera"
        )
    rotation, shift = rows_of_motion(matrix(stored, where, (4, 4)), where)
    return Mount(checked_rotation(rotation, where), shift)


def listed_pictures(camera: Path, notes: list[str]) -> list[TimedFile]:
    """The pictures of a camera with their stamps, in time order; rows and pictures without one another are noted.

    Raises:  InputError for a list that cannot be read, or none of whose pictures is there.
    """
    rows = nanosecond_list(camera / LIST, camera / "data", notes)
    found = [row for row in rows if row.file.is_file()]
    if not found:
        raise InputError(f"{camera / LIST}: none of its pictures is in {camera / 'data'}, such as {rows[0].file.name}")
    lacking = [row.file.name for row in rows if not row.file.is_file()]
    stored = [file for file in visible_files(camera / "data") if file.suffix.lower() in PICTURE_ENDINGS]
    listed = {row.file for row in rows}
    unlisted = [file.name for file in stored if file not in listed]
    if lacking:
        notes.append(f"{camera.name}/{LIST}: without a picture, left out: {shortened(lacking)}")
    if unlisted:
        notes.append(f"{camera.name}/data: without a line in {LIST}, left out: {shortened(unlisted)}")
    return found


def pairs(left: list[TimedFile], right: list[TimedFile], notes: list[str]) -> tuple[list[TimedFile], list[Path]]:
    """The left pictures with a right one at most `PAIRED` away in time, and these; the others are noted.

    Raises:  InputError if no pair is left.
    """
    stamps = np.array([row.stamp for row in right], np.int64)
    nearest = [int(np.abs(stamps - row.stamp).argmin()) for row in left]
    kept = [(row, k) for row, k in zip(left, nearest) if abs(int(stamps[k]) - row.stamp) <= PAIRED]
    if not kept:
        raise InputError(
            f"{right[0].file.parent}: no picture within {PAIRED / 1e6:g} ms of one of {left[0].file.parent}; use"
            " cameras that are triggered together, or a folder without cam1"
        )
    alone = {row.file.name for row in left} - {row.file.name for row, _ in kept}
    other = {row.file.name for row in right} - {right[k].file.name for _, k in kept}
    for name, files in zip(CAMERAS, (alone, other)):
        if files:
            notes.append(f"{name}: without a picture of the other camera, left out: {shortened(sorted(files))}")
    return [row for row, _ in kept], [right[k].file for _, k in kept]


def _cameras(body: Path, options: SourceOptions, size: tuple[int, int], pair: bool, notes: list[str]) -> StatedCamera:
    """The stated camera, or that of sensor.yaml, and of a pair both. Raises InputError."""
    files = [body / name / SENSOR for name in CAMERAS]
    if options.calibration is not None or options.camera is not None or not files[0].is_file():
        if files[0].is_file():
            notes.append(f"{SENSOR}: its intrinsics are overridden by those that are stated")
        return stated_camera(options, *size, body)
    left = calibrated(files[0], *size)
    notes += [f"cam0/{SENSOR}: {HALF_A_PIXEL}", *left.notes]
    left = left._replace(notes=())
    if not pair:
        return left
    if not files[1].is_file():
        notes.append(f"cam1/{SENSOR} is missing: both cameras count as rectified")
        return left._replace(baseline=options.baseline)
    right, here, there = calibrated(files[1], *size), mount(files[0]), mount(files[1])
    turn = there.rotation.T @ here.rotation
    shift = 1000.0 * there.rotation.T @ (here.shift - there.shift)
    assert left.intrinsics is not None and right.intrinsics is not None
    both = StereoCalibration(left.intrinsics, right.intrinsics, turn, shift)
    return StatedCamera(calibration=both, notes=right.notes)


def _poses(body: Path, options: SourceOptions, times: np.ndarray, notes: list[str]) -> list[CameraPose | None] | None:
    """World-to-camera poses of cam0 at times in seconds: --trajectory, or the ground truth times T_BS."""
    truth = body / TRUTH / LIST
    if options.trajectory is not None:
        stated = read_trajectory(
            options.trajectory, options.trajectory_unit or USUAL_UNIT, options.direction, options.axes or "opencv"
        )
        notes += [f"{options.trajectory.name}: poses of the camera", *stated.notes]
        notes += [f"{TRUTH}: not used, because --trajectory is stated"] if truth.is_file() else []
        return _some(poses_at(stated.in_seconds(), times, LONGEST), options.trajectory)
    if not truth.is_file():
        notes.append(f"{TRUTH}/{LIST} is missing: the camera counts as static")
        return None
    found = read_trajectory(truth, "m")
    camera = mount(body / CAMERAS[0] / SENSOR)
    sensor = mount(truth.with_name(SENSOR), Mount(np.eye(3), np.zeros(3)))
    # x_sensor = sensor^-1 camera x_camera, and world-to-camera is its inverse after world-to-sensor.
    turn = sensor.rotation.T @ camera.rotation
    back = inverse_pose(turn, 1000.0 * sensor.rotation.T @ (camera.shift - sensor.shift))
    notes.append(f"{TRUTH}: its poses and the T_BS of both sensors give the poses of cam0; {'; '.join(found.notes)}")
    timed = found._replace(stamps=found.stamps * 1e-9)
    return [
        pose and CameraPose(back.rotation @ pose.rotation, back.rotation @ pose.translation + back.translation)
        for pose in _some(poses_at(timed, times, LONGEST), truth)
    ]


def _some(poses: list[CameraPose | None], path: Path) -> list[CameraPose | None]:
    """The poses. Raises InputError if no picture has one."""
    if not any(poses):
        raise InputError(f"{path}: no pose at the time of any picture; use stamps of the clock of {LIST} of cam0")
    return poses


def describe_euroc(path: Path, options: SourceOptions) -> Clip:
    """The folder as a clip. Raises InputError."""
    body, notes = _body(path), []
    if not recognises(path):
        raise InputError(f"{path}: use a folder with {BODY}/{CAMERAS[0]}/{LIST}, or {BODY} itself")
    left, right = listed_pictures(body / CAMERAS[0], notes), []
    if (body / CAMERAS[1] / LIST).is_file():
        left, right = pairs(left, listed_pictures(body / CAMERAS[1], notes), notes)
    files = [row.file for row in left]
    width, height = size_of(files)
    camera = _cameras(body, options, (width, height), bool(right), notes)
    seconds = np.array([row.stamp for row in left], np.float64) * 1e-9
    poses = _poses(body, options, seconds, notes)
    times = np.array([row.stamp - left[0].stamp for row in left], np.float64) * 1e-9
    inside = {body: LAYOUT.reads, **dict.fromkeys((body / name for name in (*CAMERAS, TRUTH)), (LIST, SENSOR, "data"))}
    return Clip(
        layout="euroc",
        where=path,
        names=[file.stem for file in files],
        pictures=pictures_from_files(files, right),
        masks=stated_masks(options, files, width, height),
        depth=stated_depth(options, files),
        unit=unit_of(options),
        intrinsics=camera.intrinsics,
        calibration=camera.calibration,
        baseline=camera.baseline,
        poses=poses,
        rate=usual_rate(times),
        times=times,
        inside=together(inside, folders_of([*files, *right])),
        notes=[*picture_notes([*files, *right]), *notes, *camera.notes],
    )


LAYOUT = Layout(
    name="euroc",
    about=f"a folder with {BODY}/{CAMERAS[0]}/{LIST}",
    rank=3,
    recognises=recognises,
    describe=describe_euroc,
    takes=("camera", "distortion", "calibration", "baseline", "trajectory", "masks", "depth"),
    reads=(BODY, *READS, TRUTH),
)
