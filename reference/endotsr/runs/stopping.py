"""Signals that stop a command: each is raised as KeyboardInterrupt and recorded.

Python raises the exception at whatever point the main thread has reached. Inside a callback of compiled code (the
loader of a kernel) the exception cannot be caught: Python drops it there, and the command continues or fails with
another error. Long work therefore calls `stop_asked` at intervals, and treats an error after a signal as an
interruption.

Work that must not be abandoned half-done runs inside `finishing`, where the first signal is only recorded, for
PATIENCE seconds.
"""

import _thread
import contextlib
import signal
import threading
from collections.abc import Iterator

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name)]
PATIENCE = 0.7  # seconds after the first signal within which work inside `finishing` must end

_asked = threading.Event()
_finishing: list[threading.Timer] = []  # the clocks of the open `finishing` blocks, started by the first signal


@contextlib.contextmanager
def signals_stop() -> Iterator[None]:
    """In the block, SIGTERM (a batch system, a shutdown) acts like Ctrl-C: KeyboardInterrupt in the main thread.

    So does SIGBREAK, which Windows sends for Ctrl-Break and when a console is closed; it has no SIGTERM of others.
    """
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
    before = {number: signal.signal(number, stop) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def finishing() -> Iterator[None]:
    """In the block, the first signal raises nothing for PATIENCE seconds; the work there calls `stop_asked`.

    After that time, or at a second signal, KeyboardInterrupt is raised as outside the block.
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
    """Whether a signal has arrived since the command began."""
    return _asked.is_set()
