"""log.jsonl: one line an iteration, cut at the checkpoint when a run is resumed."""

import contextlib
import json
import os
from pathlib import Path
from typing import IO, Any

from endotsr.runs.files import finite


class RunLog:
    """log.jsonl opened for appending after iteration `kept`; later and broken lines are cut off first."""

    def __init__(self, path: Path, kept: int) -> None:
        self.seconds = 0.0  # sum over the kept lines
        self._end = self._cut(path, kept)
        self._file: IO[bytes] = path.open("ab")

    def _cut(self, path: Path, kept: int) -> int:
        end = 0
        if path.exists():
            with path.open("r+b") as file:
                for line in file:
                    entry = _entry(line)
                    if entry is None or entry["iteration"] > kept:
                        break
                    end += len(line)
                    self.seconds += entry.get("seconds") or 0.0
                file.truncate(end)
        return end

    def append(self, entry: dict[str, Any]) -> None:
        """One line, flushed. On an error of the file system the log keeps its last whole line."""
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
        """Close the file; lines that could not be written are dropped."""
        with contextlib.suppress(OSError):
            self._file.close()


def _entry(line: bytes) -> dict[str, Any] | None:
    with contextlib.suppress(ValueError):
        entry = json.loads(line)
        if line.endswith(b"\n") and isinstance(entry, dict) and "iteration" in entry:
            return entry
    return None
