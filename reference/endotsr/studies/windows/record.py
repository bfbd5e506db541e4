"""windows.json: frames and start of every window. Written once, before training.

    {"format": "endotsr-windows-1", "source": "/data/recording", "frames": 400, "overlap": 8, "chain": 1,
     "windows": [{"name": "000", "first": 0, "end": 64, "start": "cold", "begins": "the recording begins"}, ...],
     "left_out": [{"first": 120, "end": 121, "reason": "..."}]}

`first` and `end` count the frames that `sequence.frames` of config.toml selects; `end` is exclusive.
"""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from endotsr.errors import InputError
from endotsr.training.runs.files import read_json, write_json
from endotsr.untrusted.json import typed
from endotsr.untrusted.names import plain_line

FILE, FOLDER, FORMAT = "windows.json", "windows", "endotsr-windows-1"
MOST = 1 << 24  # frames of a recording
Count = Annotated[int, msgspec.Meta(ge=0, le=MOST)]
PositiveCount = Annotated[int, msgspec.Meta(ge=1, le=MOST)]
Words = Annotated[str, msgspec.Meta(max_length=4096, pattern="^[^\\x00]*$")]


class Window(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One window."""

    name: Annotated[str, msgspec.Meta(pattern="^[0-9]{3,8}$")]  # of its folder
    first: Count  # frame
    end: PositiveCount  # exclusive
    start: Literal["cold", "warm"]  # from the initialisation, or from the previous window
    begins: Words  # why it begins there

    @property
    def count(self) -> int:
        """Number of frames."""
        return self.end - self.first


class LeftOut(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Frames outside every window."""

    first: Count
    end: PositiveCount
    reason: Words


class WindowsRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The content of windows.json."""

    format: Literal["endotsr-windows-1"] = FORMAT
    source: Words
    frames: PositiveCount  # of the recording, including the left-out ones
    overlap: Count  # minimum number of frames shared by neighbours
    chain: PositiveCount  # length of a chain; every window but its first starts warm
    windows: list[Window]
    left_out: list[LeftOut] = []

    def shared(self, k: int) -> int:
        """Number of frames that window k shares with window k - 1; 0 for the first window and after a cut."""
        return max(0, self.windows[k - 1].end - self.windows[k].first) if k else 0


def is_windowed(run: Path) -> bool:
    """Whether a run folder contains windows."""
    return (Path(run) / FILE).is_file()


def write_record(run: Path, record: WindowsRecord) -> None:
    """Write windows.json into a run folder."""
    write_json(run / FILE, msgspec.to_builtins(record))


def read_record(run: Path) -> WindowsRecord:
    """windows.json of a run folder, checked.

    Raises: InputError naming file and key: a wrong type; a window that is empty, out of range, out of order, or shares
            frames with a window other than its neighbours; a warm window that shares no frame with the previous one.
    """
    path = Path(run) / FILE
    record = typed(read_json(path), WindowsRecord, path)
    if not record.windows:
        raise InputError(f"{path}: windows: there is none; use at least one")
    for k, window in enumerate(record.windows):
        if wrong := _wrong(record, k, window):
            raise InputError(f"{path}: windows: {plain_line(window.name)}: {wrong}")
    return record


def _wrong(record: WindowsRecord, k: int, window: Window) -> str:
    """The fault of a window, as text; "" if it is valid."""
    windows = record.windows
    if window.name != f"{k:03d}":
        return f"use the name {k:03d}, in the order of the frames"
    if not window.first < window.end <= record.frames:
        return f"frames {window.first}:{window.end}; use frames with first < end <= {record.frames}"
    if k and not (windows[k - 1].first < window.first and windows[k - 1].end < window.end):
        return "begins or ends no later than the previous window"
    if k > 1 and windows[k - 2].end > window.first:
        return f"shares frames with window {k - 2:03d}; a window shares frames with its neighbours only"
    if window.start == "warm" and not record.shared(k):
        return "starts warm but shares no frame with the previous window"
    return ""
