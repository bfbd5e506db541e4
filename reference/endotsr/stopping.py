"""Signals that stop a command: raised as KeyboardInterrupt, and remembered.

Python raises the exception at whatever the main thread is doing. Within a callback of compiled code (the loader of a
kernel) nobody can catch it: Python drops it there, and the command goes on or fails of something else. Whoever works
for long therefore asks `stop_asked` now and then, and calls an error after a signal an interruption.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator

_asked = threading.Event()


@contextlib.contextmanager
def signals_stop() -> Iterator[None]:
    """Inside, SIGTERM (a batch system, a shutdown) does what Ctrl-C does: KeyboardInterrupt in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: object) -> None:
        _asked.set()
        raise KeyboardInterrupt

    _asked.clear()
    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def stop_asked() -> bool:
    """Whether a signal came since the command began."""
    return _asked.is_set()
