"""windows.json: the frames of every window and how it starts. Written once, before the first window is trained.

    {"format": "endotsr-windows-1", "source": "/data/recording", "frames": 400, "overlap": 8, "chain": 1,
     "windows": [{"name": "000", "first": 0, "end": 64, "start": "cold", "begins": "the recording begins"}, ...],
     "left_out": [{"first": 120, "end": 121, "reason": "..."}]}

`first` and `end` count the frames that `sequence.frames` of config.toml selects; `end` is the first frame behind.
"""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from endotsr.errors import InputError
from endotsr.runs.files import read_json, write_json
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
    end: PositiveCount  # the first frame behind it
    start: Literal["cold", "warm"]  # from the initialisation, or from the state of the window before
    begins: Words  # why it begins where it does

    @property
    def count(self) -> int:
        """Number of frames."""
        return self.end - self.first


class LeftOut(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Frames that are in no window."""

    first: Count
    end: PositiveCount
    reason: Words


class WindowsRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All of windows.json."""

    format: Literal["endotsr-windows-1"] = FORMAT
    source: Words
    frames: PositiveCount  # of the recording, those left out included
    overlap: Count  # frames that neighbours share at least
    chain: PositiveCount  # windows in a row of which each but the first starts warm
    windows: list[Window]
    left_out: list[LeftOut] = []

    def shared(self, k: int) -> int:
        """Frames that window k shares with the window before; 0 for the first and behind a cut."""
        return max(0, self.windows[k - 1].end - self.windows[k].first) if k else 0


def is_windowed(run: Path) -> bool:
    """Whether a run folder is one of windows."""
    return (Path(run) / FILE).is_file()


def write_record(run: Path, record: WindowsRecord) -> None:
    """Write windows.json into a run folder."""
    write_json(run / FILE, msgspec.to_builtins(record))


def read_record(run: Path) -> WindowsRecord:
    """windows.json of a run folder, checked.

    Raises: InputError naming file and key: not of this type, a window that is empty, reaches beyond the recording, is
            out of order, or shares frames with more than its neighbours; a first or lonely window that starts warm.
    """
    path = Path(run) / FILE
    record = typed(read_json(path), WindowsRecord, path)
    if not record.windows:
        raise InputError(f"{path}: windows: there is none; allowed: at least one")
    for k, window in enumerate(record.windows):
        if wrong := _wrong(record, k, window):
            raise InputError(f"{path}: windows: {plain_line(window.name)}: {wrong}")
    return record


def _wrong(record: WindowsRecord, k: int, window: Window) -> str:
    """What is wrong with a window, in words; "" if nothing is."""
    windows = record.windows
    if window.name != f"{k:03d}":
        return f"allowed: the name {k:03d}, in the order of the frames"
    if not window.first < window.end <= record.frames:
        return f"frames {window.first}:{window.end}; allowed: first < end <= {record.frames}"
    if k and not (windows[k - 1].first < window.first and windows[k - 1].end < window.end):
        return "begins or ends no later than the window before"
    if k > 1 and windows[k - 2].end > window.first:
        return "shares frames with the window before the last"
    if window.start == "warm" and not record.shared(k):
        return "starts warm without a frame that it shares with the window before"
    return ""
