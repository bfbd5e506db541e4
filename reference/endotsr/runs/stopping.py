"""Signals that stop a command: raised as KeyboardInterrupt, and remembered.

Python raises the exception wherever the main thread happens to be. Inside a callback of compiled code (the loader of a
kernel) the exception cannot be caught: Python drops it there, and the command continues or fails with another error.
Long work therefore calls `stop_asked` from time to time, and treats an error after a signal as an interruption.

Work that must not be lost half-done runs inside `finishing`: there the first signal is only remembered, for PATIENCE
seconds.
"""

import _thread
import contextlib
import signal
import threading
from collections.abc import Iterator

PATIENCE = 0.7  # seconds that work inside `finishing` has to end after the first signal

_asked = threading.Event()
_finishing: list[threading.Timer] = []  # the clocks of the open `finishing` blocks, started by the first signal


@contextlib.contextmanager
def signals_stop() -> Iterator[None]:
    """Inside, SIGTERM (a batch system, a shutdown) does what Ctrl-C does: KeyboardInterrupt in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, _: object) -> None:
        first = not _asked.is_set()
        _asked.set()
        if first and _finishing:
            _finishing[-1].args = (number,)
            _finishing[-1].start()
            return
        raise KeyboardInterrupt

    _asked.clear()
    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def finishing() -> Iterator[None]:
    """Inside, the first signal raises nothing for PATIENCE seconds; the work there calls `stop_asked`.

    After that time, or at a second signal, KeyboardInterrupt is raised as elsewhere.
    """
    clock = threading.Timer(PATIENCE, _thread.interrupt_main)
    clock.daemon = True
    _finishing.append(clock)
    try:
        yield
    finally:
        _finishing.remove(clock)
        clock.cancel()


def stop_asked() -> bool:
    """Whether a signal came since the command began."""
    return _asked.is_set()
