"""The record of a sequence: the data that rendering and evaluation need without the pictures.

It is stored as `sequence.json` in a run folder and in the header of a slim model. In: a sequence, or such a file, which
is user input. Out: a checked `SequenceRecord`, or an `InputError` that names the file, the key and what is allowed.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec

from endotsr.errors import InputError
from endotsr.untrusted.files import MOST_PIXELS
from endotsr.untrusted.json import Count, Fraction, Length, Positive, Side, Text, read_json, typed
from endotsr.untrusted.names import counted, file_name

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from endotsr.clips.sequences.sequence import Sequence
    from endotsr.method.splatting.camera import Camera

RUN_FILES = ("config.toml", "run.json", "sequence.json")  # of the folder of every training
UNKNOWN_RATE = 15.0  # frames per second of films and animations of a recording of unknown rate
ROTATION_TOLERANCE = 1e-3  # largest entry of R^T R - 1
Row = tuple[Length, Length, Length]


def is_run(path: Path) -> bool:
    """Whether a folder is that of a training or of one with windows, whose pictures are results."""
    return all((path / name).is_file() for name in RUN_FILES) or (path / "windows.json").is_file()


class RecordedCamera(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The camera of a frame; see `splatting.camera.Camera`."""

    rotation: tuple[Row, Row, Row]
    translation: Row
    fx: Positive
    fy: Positive
    cx: Length
    cy: Length
    width: Side
    height: Side

    @property
    def camera(self) -> "Camera":
        """The camera with arrays."""
        import numpy as np

        from endotsr.method.splatting.camera import Camera

        rotation, translation = np.array(self.rotation, np.float64), np.array(self.translation, np.float64)
        return Camera(rotation, translation, self.fx, self.fy, self.cx, self.cy, self.width, self.height)


class SequenceRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Names, times, split and cameras of a sequence. Unknown keys of a file are ignored."""

    unit: Text  # the scene unit, in words
    largest_depth: Annotated[float, msgspec.Meta(ge=0, le=1e30)]  # scene units
    static_camera: bool
    names: list[Text]  # of the n frames, safe as file names
    times: list[Fraction]  # n times, normalised
    train_index: list[Count]
    test_index: list[Count]
    cameras: list[RecordedCamera]  # n of them, or one static camera
    duration: Annotated[float, msgspec.Meta(ge=0, le=1e12)] = 0.0  # seconds from time 0 to time 1; 0 = unknown

    @property
    def count(self) -> int:
        """Number of frames n."""
        return len(self.names)

    @property
    def train_times(self) -> "NDArray[np.float64]":
        """Times of the training frames."""
        import numpy as np

        return np.array(self.times, np.float64)[self.train_index]

    @property
    def frame_cameras(self) -> "list[Camera]":
        """The camera of every frame; the same object for all frames of a static camera."""
        found = [entry.camera for entry in self.cameras]
        return found * self.count if self.static_camera else found


def record_of(sequence: "Sequence") -> SequenceRecord:
    """The record of a sequence in memory."""
    cameras = sequence.cameras[:1] if sequence.static_camera else sequence.cameras
    return SequenceRecord(
        unit=sequence.unit,
        largest_depth=float(sequence.depth.max()),
        static_camera=sequence.static_camera,
        names=sequence.names,
        times=sequence.times.tolist(),
        train_index=sequence.train_index.tolist(),
        test_index=sequence.test_index.tolist(),
        cameras=recorded(cameras),
        duration=sequence.duration,
    )


def recorded(cameras: "list[Camera]") -> list[RecordedCamera]:
    """Cameras in the form of a record."""
    found = []
    for camera in cameras:
        pose = {"rotation": camera.rotation.tolist(), "translation": camera.translation.tolist()}
        lens = {name: float(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy")}
        sides = {name: int(getattr(camera, name)) for name in ("width", "height")}
        found.append(msgspec.convert(pose | lens | sides, RecordedCamera))
    return found


def nearest_frame(times: "list[float] | NDArray[np.float64]", time: float) -> int:
    """The frame with the nearest time; the earlier of two equally near ones."""
    return min(range(len(times)), key=lambda i: (abs(times[i] - time), i))


def read_sequence_record(path: Path) -> SequenceRecord:
    """sequence.json. Raises InputError as `checked_record`."""
    return checked_record(read_json(path), str(path))


def checked_record(data: Any, where: str, prefix: str = "") -> SequenceRecord:
    """The record in plain data.

    prefix   prefix of the keys in messages

    Raises:  InputError for a key that is missing, has another type or range, or contradicts another key: names are
             distinct, frame numbers exist, no frame is both training and held out, and cameras have a valid rotation
             and at most 2^26 pixels.
    """
    for field in msgspec.structs.fields(SequenceRecord):
        if field.required and (not isinstance(data, dict) or field.name not in data):
            raise InputError(f"{where}: {prefix}{field.name} is missing; use the record as a run wrote it")
    found = typed(data, SequenceRecord, where)
    names = [file_name(name, f"{where}: names") for name in found.names]
    if len(set(names)) < len(names):
        raise InputError(f"{where}: names: two frames have one name; use a name for each frame")
    if len(found.times) != len(names):
        raise InputError(f"{where}: times: {len(found.times)} for {counted(len(names), 'frame')}; use one per frame")
    _check_split(found, where)
    _check_cameras(found, where)
    return found


def _check_split(found: SequenceRecord, where: str) -> None:
    for key, index in (("train_index", found.train_index), ("test_index", found.test_index)):
        if index and (max(index) >= found.count or len(set(index)) < len(index)):
            raise InputError(f"{where}: {key}: use frames from 0 to {found.count - 1}, each once")
    if not found.train_index:
        raise InputError(f"{where}: train_index: holds no frame; use at least one")
    if both := set(found.train_index) & set(found.test_index):
        raise InputError(
            f"{where}: test_index: frame {min(both)} is a training frame as well; use a frame in one of both lists"
        )


def _check_cameras(found: SequenceRecord, where: str) -> None:
    expected = 1 if found.static_camera else found.count
    if len(found.cameras) != expected:
        raise InputError(f"{where}: cameras: {len(found.cameras)} of them; use {expected}")
    for k, camera in enumerate(found.cameras):
        if camera.width * camera.height > MOST_PIXELS:
            raise InputError(f"{where}: cameras: {k}: {camera.width}x{camera.height} pixels; use at most {MOST_PIXELS}")
        for i, row in enumerate(camera.rotation):
            for j, other in enumerate(camera.rotation):
                if abs(sum(a * b for a, b in zip(row, other)) - (i == j)) > ROTATION_TOLERANCE:
                    raise InputError(
                        f"{where}: cameras: {k}: rotation: its rows are not perpendicular unit vectors;"
                        " use those of a rotation matrix"
                    )
        (a, b, c), (d, e, f), (g, h, i) = camera.rotation
        if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
            raise InputError(
                f"{where}: cameras: {k}: rotation: its rows are a mirror image; use those of a rotation matrix"
            )
