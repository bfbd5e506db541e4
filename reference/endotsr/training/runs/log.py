"""log.jsonl: one line per iteration, truncated at the checkpoint on resume."""

import contextlib
import json
import os
from pathlib import Path
from typing import IO, cast

from endotsr.errors import InputError
from endotsr.training.fitting.records import LogEntry
from endotsr.training.runs.files import finite, refuse_link
from endotsr.untrusted.files import read_bytes
from endotsr.untrusted.json import integer, number, parsed

LONGEST_LINE = 1 << 20  # bytes
LARGEST_LOG = 1 << 30  # bytes: several million iterations
LONGEST_TAIL = 1 << 13  # bytes read to find the last line; longer than a line


class RunLog:
    """log.jsonl opened for appending after iteration `kept`; opening removes later and incomplete lines."""

    def __init__(self, path: Path, kept: int) -> None:
        self.seconds = 0.0  # sum over the kept lines
        self._end = self._cut(path, kept)
        self._file: IO[bytes] = path.open("ab")

    def _cut(self, path: Path, kept: int) -> int:
        end = 0
        refuse_link(path)
        if path.exists():
            with path.open("r+b") as file:
                while line := file.readline(LONGEST_LINE):
                    entry = _entry(line)
                    if entry is None or entry["iteration"] > kept:
                        break
                    end += len(line)
                    self.seconds += _seconds(entry)
                file.truncate(end)
        return end

    def append(self, entry: LogEntry) -> None:
        """Append and flush one line. On an error of the file system the log ends with its last complete line."""
        line = (json.dumps(finite(entry), separators=(", ", ": ")) + "\n").encode()
        try:
            self._file.write(line)
            self._file.flush()
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.fileno(), self._end)
            raise
        self._end += len(line)

    def close(self) -> None:
        """Close the file; errors of the file system are ignored."""
        with contextlib.suppress(OSError):
            self._file.close()


def last_iteration(path: Path) -> int:
    """The iteration of the last complete line; 0 without one."""
    entry = last_entry(path)
    return entry["iteration"] if entry else 0


def last_entry(path: Path) -> LogEntry | None:
    """The last complete line; None without one. Reads only the end of the file."""
    try:
        with path.open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - LONGEST_TAIL, 0))
            lines = file.read(LONGEST_TAIL).splitlines(keepends=True)
    except OSError:
        return None
    return next((entry for line in reversed(lines) if (entry := _entry(line)) is not None), None)


def log_until(path: Path, iteration: int) -> list[LogEntry]:
    """The valid lines of a log up to an iteration; [] without a file."""
    if not path.exists():
        return []
    lines = read_bytes(path, LARGEST_LOG).splitlines(keepends=True)
    return [entry for line in lines if (entry := _entry(line)) is not None and entry["iteration"] <= iteration]


def _entry(line: bytes) -> LogEntry | None:
    with contextlib.suppress(InputError):
        entry = parsed(line, "log.jsonl")
        if line.endswith(b"\n") and isinstance(entry, dict):
            integer(entry.get("iteration"), "iteration")
            return cast(LogEntry, entry)
    return None


def _seconds(entry: LogEntry) -> float:
    """The seconds of a line; 0 if they are missing or invalid."""
    with contextlib.suppress(InputError):
        return number(entry.get("seconds"), "seconds", low=0.0)
    return 0.0
