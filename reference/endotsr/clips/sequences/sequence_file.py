"""The file `sequence.toml` of the common format, which describes the pictures of a folder.

    format = "endotsr-sequence-1"
    source = "P2_8 (stereomis)"        # where the frames come from, in words
    frames = 120
    unit = "mm"                        # of poses and baseline; um, mm, cm, m or arbitrary
    frame_rate = 25.0                  # frames per second, on average; 0 = unknown
    times = [0.0, 0.04, 0.12, ...]     # seconds of the frames, ascending; absent: evenly spaced
    source_names = ["000120", ...]     # of the frames in the source, in a video their numbers; absent: the same names

    [camera]                           # pixels; the centre of the first pixel is at (0.5, 0.5)
    width = 640 ... height, fx, fy, cx, cy
    distortion = []                    # k1 k2 p1 p2 [k3 [k4 k5 k6]], OpenCV's order; training needs none
    baseline = 4.2                     # of a rectified pair; 0 = no stereo
    crop = []                          # x y width height of the window of the source that the pictures show; []: all
    crop_of = []                       # width height of the source pictures, in whose pixels this window is

    [masks]                            # absent: every pixel is tissue
    folder = "masks"
    excluded_value = "white"           # or "black"
    proposed = false                   # true: made by a program, not checked by a person
    origin = ""                        # where the excluded pixels come from: given, drawn, carried, proposed

    [depth]                            # absent: `endotsr depth` makes it
    folder = "depth"
    unit = "mm"
    scale = 0.01                       # length = stored value x scale, in `unit`; 0 = no depth here
    clipped = []                       # percentiles to which depth was clipped when it was resized: not repeated
    method = "given"
    assumed = ""                       # properties not measured: "", "scale and shift" or "shape"

    [poses]                            # absent: static camera at the origin
    direction = "world_to_camera"      # or "camera_to_world"
    axes = "opencv"                    # x right, y down, z forward; or "opengl": x right, y up, z backward; or "llff"
    origin = "given"                   # or, in words, the program that estimated them
    interpolated = []                       # frames whose pose is interpolated between others
    matrices = [[r00, r01, r02, t0, r10, ..., t2], ...]   # one row of 12 numbers per frame

In: the file. Out: `SequenceFile`, or an `InputError` that names the key and what is allowed. The folder `images/`
contains one picture per frame, `images_right/` the right pictures of a stereo pair.
"""

import os
import shlex
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import msgspec
import numpy as np

from endotsr.clips.formats.camera import ARBITRARY, Intrinsics, checked_intrinsics, pose_of, scene_factor
from endotsr.clips.formats.choices import Axes, Direction, Unit
from endotsr.clips.sequences.clip import Assumed
from endotsr.clips.sequences.crop import stated_crop
from endotsr.clips.sequences.record import is_run
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.names import counted, file_name
from endotsr.untrusted.sections import Section, checked, refuse_unknown_keys
from endotsr.untrusted.toml import read_toml, toml_text

FILE_NAME = "sequence.toml"
FORMAT = "endotsr-sequence-1"
IMAGES, RIGHT, MASKS, DEPTH = "images", "images_right", "masks", "depth"
# Names that commands write into a folder in the common format.
WRITTEN = (
    FILE_NAME, IMAGES, RIGHT, MASKS, DEPTH, "proposed_masks.png", "transforms.json", "sparse", "masks_kept", "truth",
)  # fmt: skip
Positive = Annotated[float, msgspec.Meta(gt=0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
PositiveCount = Annotated[int, msgspec.Meta(ge=1)]


class CameraEntry(Section, frozen=True, kw_only=True):
    """Intrinsics of all frames."""

    width: PositiveCount
    height: PositiveCount
    fx: Positive
    fy: Positive
    cx: float
    cy: float
    distortion: list[float] = msgspec.field(default_factory=list)
    baseline: NonNegative = 0.0
    crop: list[float] = msgspec.field(default_factory=list)
    crop_of: list[float] = msgspec.field(default_factory=list)

    def intrinsics(self, where: object) -> Intrinsics:
        """The intrinsics, checked. Raises InputError."""
        intrinsics = Intrinsics(self.fx, self.fy, self.cx, self.cy, self.width, self.height, tuple(self.distortion))
        return checked_intrinsics(intrinsics, where)


class MaskEntry(Section, frozen=True, kw_only=True):
    """The mask pictures."""

    folder: str = MASKS
    excluded_value: Literal["white", "black"] = "white"
    proposed: bool = False
    origin: str = ""


class DepthEntry(Section, frozen=True, kw_only=True):
    """The depth files."""

    folder: str = DEPTH
    unit: Unit = "mm"
    scale: Positive = 1.0
    clipped: list[float] = msgspec.field(default_factory=list)
    method: str = "given"
    assumed: Assumed = ""


class PoseEntry(Section, frozen=True, kw_only=True):
    """One pose per frame."""

    direction: Direction = "world_to_camera"
    axes: Axes = "opencv"
    origin: str = "given"
    interpolated: list[int] = msgspec.field(default_factory=list)
    matrices: list[list[float]]


class SequenceFile(Section, frozen=True, kw_only=True):
    """All of `sequence.toml`."""

    format: str
    frames: PositiveCount
    camera: CameraEntry
    source: str = ""
    unit: Unit = "mm"
    frame_rate: NonNegative = 0.0
    times: list[float] | None = None
    source_names: list[str] | None = None
    masks: MaskEntry | None = None
    depth: DepthEntry | None = None
    poses: PoseEntry | None = None

    @property
    def arbitrary(self) -> bool:
        """Whether the unit of the lengths is unknown."""
        return self.unit == ARBITRARY

    @property
    def depth_scale(self) -> float:
        """Scene units per stored depth value; 1 without depth."""
        return self.depth.scale * scene_factor(self.depth.unit) if self.depth else 1.0

    @property
    def baseline(self) -> float:
        """Baseline of the rectified pair, scene units; 0 without stereo."""
        return self.camera.baseline * scene_factor(self.unit)


def _refuse_unprepared(path: Path) -> NoReturn:
    from endotsr.clips.sequences.unknown_source import not_there, what_it_is

    if not os.path.lexists(path):
        raise InputError(f"{path}: {not_there(path)}")
    if is_run(path):
        raise InputError(f"{path}: has no {FILE_NAME}{what_it_is(path)}")
    what = "is a file, and no folder with" if path.is_file() else "has no"
    command = f"endotsr prepare {shlex.quote(str(path))} --out FOLDER"
    raise InputError(f"{path}: {what} {FILE_NAME}; `{command}` writes a folder with one")


def read_sequence_file(folder: Path) -> SequenceFile:
    """The checked contents of `sequence.toml` in a folder.

    Raises:  InputError naming the file, the key and what is allowed.
    """
    path = Path(folder) / FILE_NAME
    if not path.exists():
        _refuse_unprepared(Path(folder))
    data = read_toml(path)
    if data.get("format") != FORMAT:
        raise InputError(f"{path}: format = {data.get('format')!r} is not allowed; use {FORMAT!r}")
    for key, needed in (("frames", data), ("camera", data)):
        if key not in needed:
            raise InputError(f"{path}: {key} is missing")
    refuse_unknown_keys(data, SequenceFile, str(path))
    for key, kind in (("camera", CameraEntry), ("masks", MaskEntry), ("depth", DepthEntry), ("poses", PoseEntry)):
        if isinstance(data.get(key), dict):
            _check_section(data[key], kind, path, key)
    found = checked(data, SequenceFile, str(path))
    if found.depth and (found.depth.unit == ARBITRARY) != found.arbitrary:
        raise InputError(
            f"{path}: depth.unit = {found.depth.unit!r} with unit = {found.unit!r} is not allowed; use both"
            " arbitrary (then of one scale), or neither"
        )
    if found.depth and found.depth.assumed and not found.arbitrary:
        raise InputError(f"{path}: depth.assumed with unit = {found.unit!r} is not allowed; use 'arbitrary'")
    for key, entry in (("masks", found.masks), ("depth", found.depth)):
        if entry and not _plain_name(entry.folder):
            raise InputError(f"{path}: {key}.folder = {entry.folder!r} is not allowed; use a folder next to the file")
    found.camera.intrinsics(path)
    stated_crop(found.camera.crop, found.camera.crop_of, path)
    _check_times(found, path)
    _check_source_names(found, path)
    return found


def _check_times(found: SequenceFile, path: Path) -> None:
    """Raises InputError unless there is one time per frame, in ascending order; `checked` has refused infinity."""
    if found.times is None:
        return
    if len(found.times) != found.frames:
        raise InputError(
            f"{path}: times: {len(found.times)} numbers for {counted(found.frames, 'frame')}; use one per frame"
        )
    steps = np.diff(found.times)
    if (steps <= 0).any():
        wrong = int(np.flatnonzero(steps <= 0)[0]) + 1
        raise InputError(f"{path}: times: frame {wrong}: {found.times[wrong]:g}; use finite, ascending seconds")


def _check_source_names(found: SequenceFile, path: Path) -> None:
    """Raises InputError unless there is one safe name per frame, each once."""
    names = found.source_names
    if names is None:
        return
    if len(names) != found.frames:
        raise InputError(
            f"{path}: source_names: {counted(len(names), 'name')} for {counted(found.frames, 'frame')};"
            " use one per frame"
        )
    for name in names:
        file_name(name, f"{path}: source_names")
    if len(set(names)) < len(names):
        raise InputError(f"{path}: source_names: two frames have one name; use each name once")


def _check_section(data: dict, kind: type[Section], path: Path, key: str) -> None:
    """Raises InputError for a missing key or an invalid list of numbers in a section, naming the full key."""
    refuse_unknown_keys(data, kind, str(path), f"{key}.")
    for field in msgspec.structs.fields(kind):
        if field.required and field.name not in data:
            raise InputError(f"{path}: {key}.{field.name} is missing")
    try:
        msgspec.convert(data.get("matrices", []), list[list[float]], strict=True)
        for name in ("distortion", "clipped", "crop", "crop_of"):
            msgspec.convert(data.get(name, []), list[float], strict=True)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {key}: a list of numbers is expected: {error}") from None
    checked(data, kind, str(path), f"{key}.")


def _plain_name(folder: str) -> bool:
    return bool(folder) and Path(folder).name == folder and folder not in (".", "..")


def read_poses(found: SequenceFile, path: Path) -> tuple[list[CameraPose | None] | None, dict[int, str]]:
    """Poses with translation in scene units, None for a static camera; and why a frame has none.

    Raises:  InputError for a wrong number of poses.
    """
    if found.poses is None:
        return None, {}
    rows = found.poses.matrices
    if len(rows) != found.frames:
        raise InputError(
            f"{path}: poses.matrices: {len(rows)} rows for {counted(found.frames, 'frame')}; use one row per frame"
        )
    poses: list[CameraPose | None] = []
    faults = {}
    for i, row in enumerate(rows):
        try:
            poses.append(_pose(row, found.poses, scene_factor(found.unit), f"{path}: poses.matrices: frame {i}"))
        except InputError as error:
            poses.append(None)
            faults[i] = str(error)
    return poses, faults


def _pose(row: list[float], entry: PoseEntry, scale: float, where: str) -> CameraPose:
    if len(row) != 12:
        raise InputError(f"{where}: {len(row)} numbers; use 12, the rows of a 3x4 matrix")
    matrix = np.array(row, np.float64).reshape(3, 4)
    return pose_of(matrix[:, :3], matrix[:, 3] * scale, entry.direction, entry.axes, where)


def write_sequence_file(found: SequenceFile, folder: Path) -> None:
    """Write `sequence.toml`. `read_sequence_file` returns an equal value."""
    (Path(folder) / FILE_NAME).write_text(sequence_text(found), encoding="utf-8", newline="\n")


def sequence_text(found: SequenceFile) -> str:
    """The contents as TOML text."""
    return toml_text(msgspec.to_builtins(found))
