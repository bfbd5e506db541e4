"""One process at a time: the lock of a sweep, and that of a checkpoint which several runs begin with.

The system releases the lock of a process that was killed. Without effect where the disk has no locks.
"""

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

from endotsr.runs.folder import RunBusy, RunFolder, lock_taken

POLL = 0.5  # seconds between two attempts
PATIENCE = 60.0  # seconds without progress of the holder after which an attempt is given up


@contextlib.contextmanager
def file_lock(path: Path, message: str = "", *, wait: bool = False) -> Iterator[None]:
    """Hold the lock of a file, which is created, for the block.

    wait     wait until it is free, without a limit
    Raises:  RunBusy with `message` if another process holds it and `wait` is False.
    """
    with path.open("ab") as file:
        while not lock_taken(file):
            if not wait:
                raise RunBusy(message)
            time.sleep(POLL)
        yield


@contextlib.contextmanager
def run_lock(folder: RunFolder, patience: float = PATIENCE) -> Iterator[None]:
    """Hold the lock of a run; a holder that is still at work, as its log shows, is waited for.

    A worker that a cluster has given up can still be training: its run is taken over only when the worker has ended.
    Raises: RunBusy if the log of the run has not grown for `patience` seconds.
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
