"""What an estimate of poses does with a folder: open it, complete the poses, and record them.

In: a folder in the common format, and poses of which some may be missing. Out: `SequenceFile` and `Clip`, one camera
for each frame, the section [poses], and sentences on the gaps.
"""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np

from endotsr.clips.formats.camera import scene_factor
from endotsr.clips.formats.files import shortened
from endotsr.clips.formats.trajectory import filled
from endotsr.clips.poses.views import Views
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.clips.sequences.sequence_file import FILE_NAME, PoseEntry, SequenceFile, read_sequence_file
from endotsr.clips.sequences.view_frames import views_of
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, CameraPose

LEAST_WIDTH, LEAST_HEIGHT = 96, 64  # pixels; narrower pictures make a scope that moves look still


def open_for_poses(folder: Path, replace: bool) -> tuple[SequenceFile, Clip]:
    """The folder in the common format, for an estimate of its poses.

    Raises:  InputError for poses that may not be replaced, distorted or very small pictures, or a single frame.
    """
    file, clip = read_sequence_file(folder), describe_prepared(folder)
    if file.poses and not replace:
        raise InputError(f"{folder}: has poses already ({file.poses.origin}); --replace estimates new ones")
    if any(file.camera.distortion):
        raise InputError(f"{folder}: the pictures are distorted; endotsr prepare {folder} --out NEW straightens them")
    if clip.count < 2:
        raise InputError(f"{folder}: one frame: there is no motion to estimate")
    width, height = file.camera.width, file.camera.height
    if width < LEAST_WIDTH or height < LEAST_HEIGHT:
        raise InputError(
            f"{folder}: pictures of {width}x{height} pixels are too small to estimate poses from; use at least"
            f" {LEAST_WIDTH}x{LEAST_HEIGHT}, with a larger endotsr prepare --scale"
        )
    return file, clip


def as_now(folder: Path, opened: SequenceFile) -> SequenceFile:
    """`sequence.toml` as it is after the estimate: another command may have added masks meanwhile, and nothing else.

    Raises:  InputError, because poses fit the depth and the unit from which they were estimated.
    """
    now = read_sequence_file(folder)
    if msgspec.structs.replace(now, masks=opened.masks) != opened:
        raise InputError(
            f"{folder / FILE_NAME}: was changed while the poses were estimated, hence they are not written; repeat the"
            " command when no other one writes this folder"
        )
    return now


def resting_views(clip: Clip) -> Views:
    """All frames of a clip, with the camera that it would have without poses. Raises InputError."""
    return views_of(clip, dataclasses.replace(clip, poses=None).cameras([0])[0])


def pose_entry(cameras: list[Camera], unit: str, origin: str, interpolated: list[int]) -> PoseEntry:
    """The section [poses] of one camera per frame, in scene units; `unit` is that of the file."""
    factor = scene_factor(unit)
    rows = [np.column_stack([c.rotation, c.translation / factor]).ravel().tolist() for c in cameras]
    return PoseEntry(origin=origin, interpolated=interpolated, matrices=rows)


def cameras_of(poses: list[CameraPose | None], first: Camera) -> tuple[list[Camera], list[int], list[int]]:
    """A camera for each frame: gaps are interpolated, and both ends are held.

    poses   relative to the camera `first`; None for a gap
    returns the cameras, the frames that are interpolated, and those before the first or after the last pose
    """
    without = [k for k, pose in enumerate(poses) if pose is None]
    known = [k for k, pose in enumerate(poses) if pose is not None]
    held = [k for k in without if k < known[0] or k > known[-1]]
    cameras = [
        first._replace(
            rotation=pose.rotation @ first.rotation,
            translation=pose.rotation @ first.translation + pose.translation,
        )
        for pose in filled(poses)
    ]
    return cameras, [k for k in without if k not in held], held


def gap_lines(interpolated: list[int], held: list[int]) -> list[str]:
    """The sentences on frames without a pose of their own."""
    lines = [f"without matches, the pose is interpolated: {_named(interpolated)}"] if interpolated else []
    return lines + ([f"before the first or after the last pose, which is held: {_named(held)}"] if held else [])


def _named(frames: list[int]) -> str:
    word = "frame" if len(frames) == 1 else f"{len(frames)} frames"
    return f"{word} {shortened([str(k) for k in frames])}"
