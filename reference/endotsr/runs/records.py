"""run.json and sequence.json: run.json at the start of a run, and what another person's run folder may say.

Every key that is there must have the type and the range below. A key may be missing: whoever needs it names it
(`RunFolder.record`), because earlier versions wrote fewer.
"""

from pathlib import Path
from typing import Annotated, Any

import msgspec

from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.runs.machine import machine, now, versions
from endotsr.untrusted.names import file_name, plain_line
from endotsr.untrusted.png import MOST_PIXELS

MOST_COUNT = 1 << 53
ROTATION_TOLERANCE = 1e-3  # largest entry of R^T R - 1
Count = Annotated[int, msgspec.Meta(ge=0, le=MOST_COUNT)]
Side = Annotated[int, msgspec.Meta(ge=1, le=MOST_PIXELS)]
Seconds = Annotated[float, msgspec.Meta(ge=0, le=1e12)]
Fraction = Annotated[float, msgspec.Meta(ge=0, le=1)]
Length = Annotated[float, msgspec.Meta(ge=-1e30, le=1e30)]
Positive = Annotated[float, msgspec.Meta(gt=0, le=1e30)]
Text = Annotated[str, msgspec.Meta(max_length=1 << 16, pattern="^[^\\x00]*$")]
Row = tuple[Length, Length, Length]


class _Part(msgspec.Struct, kw_only=True):
    """Part of a record; keys that are not listed are left alone."""


class InputPart(_Part, kw_only=True):
    """`input` of run.json."""

    source: Text | msgspec.UnsetType = msgspec.UNSET
    frames: Count | msgspec.UnsetType = msgspec.UNSET
    width: Side | msgspec.UnsetType = msgspec.UNSET
    height: Side | msgspec.UnsetType = msgspec.UNSET
    training_frames: Count | msgspec.UnsetType = msgspec.UNSET
    held_out_frames: Count | msgspec.UnsetType = msgspec.UNSET
    tissue_fraction: Fraction | msgspec.UnsetType = msgspec.UNSET
    static_camera: bool | msgspec.UnsetType = msgspec.UNSET
    notes: list[Text] = []
    arrays_sha256: dict[Text, Text] = {}
    files_sha256: dict[Text, Text] = {}
    simulator: dict[str, Any] = {}


class MachinePart(_Part, kw_only=True):
    """`machine` of run.json."""

    processor: Text | msgspec.UnsetType = msgspec.UNSET
    cores: Count | msgspec.UnsetType = msgspec.UNSET
    memory_bytes: Count | None = None
    system: Text | msgspec.UnsetType = msgspec.UNSET


class RunRecord(_Part, kw_only=True):
    """run.json."""

    status: Text | None = None
    command: list[Text] = []
    started: Text | None = None
    finished: Text | None = None
    seconds: Seconds = 0.0
    iterations_done: Count | None = None
    lambda_lap: Annotated[float, msgspec.Meta(ge=0, le=1e30)] | None = None
    peak_memory_bytes: Count | None = None
    seed: Count | None = None
    threads: Count | None = None
    versions: dict[Text, Text] = {}
    machine: MachinePart = msgspec.field(default_factory=MachinePart)
    input: InputPart = msgspec.field(default_factory=InputPart)
    resumed: list[dict[str, Any]] = []


class CameraPart(_Part, kw_only=True, forbid_unknown_fields=True):
    """An entry of `cameras` of sequence.json; see `splatting.camera.Camera`."""

    rotation: tuple[Row, Row, Row]
    translation: Row
    fx: Positive
    fy: Positive
    cx: Length
    cy: Length
    width: Side
    height: Side


class SequenceRecord(_Part, kw_only=True):
    """sequence.json."""

    unit: Text | msgspec.UnsetType = msgspec.UNSET
    largest_depth: Annotated[float, msgspec.Meta(ge=0, le=1e30)] | msgspec.UnsetType = msgspec.UNSET
    static_camera: bool | msgspec.UnsetType = msgspec.UNSET
    names: list[Text] | msgspec.UnsetType = msgspec.UNSET
    times: list[Fraction] | msgspec.UnsetType = msgspec.UNSET
    train_index: list[Count] | msgspec.UnsetType = msgspec.UNSET
    test_index: list[Count] | msgspec.UnsetType = msgspec.UNSET
    cameras: list[CameraPart] | msgspec.UnsetType = msgspec.UNSET


REPORTED = (
    *(f"input.{key}" for key in ("source", "frames", "width", "height", "training_frames", "held_out_frames")),
    *("input.tissue_fraction", "input.notes", "input.arrays_sha256", "versions", "seconds"),
    *(f"machine.{key}" for key in ("processor", "cores", "memory_bytes", "system")),
)
"""Keys of run.json that a report needs."""


def new_record(command: list[str], config: Config, threads: int, source: dict[str, Any]) -> dict[str, Any]:
    """The entries of run.json at the start of a run.

    command   command line of the run, one string a word
    threads   kernel threads in use
    source    `input_record` of the sequence
    """
    return {
        "status": "running",
        "command": command,
        "started": now(),
        "finished": None,
        "seconds": 0.0,
        "iterations_done": 0,
        "lambda_lap": None,
        "peak_memory_bytes": None,
        "seed": config.training.seed,
        "threads": threads,
        "versions": versions(),
        "machine": machine(),
        "input": source,
        "resumed": [],
    }


def check_run_record(record: dict[str, Any], path: Path) -> None:
    """Raises InputError naming file and key if run.json holds a value of another type or range."""
    _typed(record, RunRecord, path)


def check_sequence_record(record: dict[str, Any], path: Path) -> None:
    """Raises InputError naming file and key if sequence.json contradicts its types, or one key another.

    Names can be the names of files and are distinct, frame numbers exist, no frame is both training and held out, and
    cameras have a rotation and at most 2^26 pixels. A static camera is listed once.
    """
    found = _typed(record, SequenceRecord, path)
    names = [file_name(name, f"{path}: names") for name in found.names or ()]  # UNSET is false
    if len(set(names)) < len(names):
        raise InputError(f"{path}: names: two frames have one name; allowed: a name for each frame")
    if isinstance(found.names, list) and isinstance(found.times, list) and len(found.times) != len(names):
        raise InputError(f"{path}: times: {len(found.times)} for {len(names)} frames; allowed: one a frame")
    train, test = found.train_index or [], found.test_index or []
    count = len(names or found.times or ())
    for key, index in (("train_index", train), ("test_index", test)):
        if index and (max(index) >= count or len(set(index)) < len(index)):
            raise InputError(f"{path}: {key}: allowed: frames from 0 to {count - 1}, each once")
    if set(train) & set(test):
        raise InputError(f"{path}: test_index: frame {min(set(train) & set(test))} is a training frame as well")
    if isinstance(found.cameras, list) and isinstance(found.static_camera, bool) and count:
        _check_cameras(found.cameras, 1 if found.static_camera else count, path)


def _check_cameras(cameras: list[CameraPart], expected: int, path: Path) -> None:
    if len(cameras) != expected:
        raise InputError(f"{path}: cameras: {len(cameras)} of them; allowed: {expected}")
    for k, camera in enumerate(cameras):
        if camera.width * camera.height > MOST_PIXELS:
            raise InputError(f"{path}: cameras: {k}: {camera.width}x{camera.height} pixels; allowed: {MOST_PIXELS}")
        for i, row in enumerate(camera.rotation):
            for j, other in enumerate(camera.rotation):
                if abs(sum(a * b for a, b in zip(row, other)) - (i == j)) > ROTATION_TOLERANCE:
                    raise InputError(f"{path}: cameras: {k}: rotation: its rows are not perpendicular unit vectors")


def _typed(record: dict[str, Any], kind: type[Any], path: Path) -> Any:
    try:
        return msgspec.convert(record, kind, strict=True)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at `$")
        key = place.strip("`.") or "its content"
        raise InputError(f"{path}: {plain_line(key)}: {plain_line(reason[:1].lower() + reason[1:])}") from None
