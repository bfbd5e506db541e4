"""File locks of a sweep, of its shared checkpoints, and of its runs.

The system releases the lock of a killed process. On a disk without locks they have no effect.
"""

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

from endotsr.training.runs.folder import RunBusy, RunFolder, lock_taken

POLL = 0.5  # seconds between two attempts
PATIENCE = 60.0  # seconds without progress of the holder until RunBusy is raised


@contextlib.contextmanager
def file_lock(path: Path, message: str = "", *, wait: bool = False) -> Iterator[None]:
    """Hold the lock of a file for the block; creates the file.

    wait     wait for the lock, without a time limit
    Raises:  RunBusy with `message` if another process holds the lock and `wait` is False.
    """
    with path.open("ab") as file:
        while not lock_taken(file):
            if not wait:
                raise RunBusy(message)
            time.sleep(POLL)
        yield


@contextlib.contextmanager
def run_lock(folder: RunFolder, patience: float = PATIENCE) -> Iterator[None]:
    """Hold the lock of a run for the block; wait as long as the log of the run grows.

    A worker that a cluster counts as lost can still be training. Its run is taken over only after it has ended.
    Raises: RunBusy if the lock is held and the log has not grown for `patience` seconds.
    """
    size, since = -1, time.monotonic()
    with contextlib.ExitStack() as stack:
        while True:
            try:
                stack.enter_context(folder.locked())
                break
            except RunBusy:
                found = folder.log.stat().st_size
                if found != size:
                    size, since = found, time.monotonic()
                if time.monotonic() - since > patience:
                    raise
                time.sleep(POLL)
        yield
