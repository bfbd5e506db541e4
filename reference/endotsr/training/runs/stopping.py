"""Signals that stop a command: each is recorded and raised as KeyboardInterrupt.

Python raises the exception at an arbitrary point of the main thread. Inside a callback from compiled code, such as the
loader of a kernel, Python discards the exception; the command then continues or fails with another error. Long
computations therefore call `stop_asked` regularly, and treat an error after a signal as an interruption.

Inside `finishing`, the first signal is only recorded, for PATIENCE seconds. Use it for work that must be completed.
"""

import _thread
import contextlib
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
PATIENCE = 0.7  # seconds after the first signal within which work inside `finishing` must end
INTERRUPTED = 130  # exit code, 128 + SIGINT as in a shell
LONGEST_WAIT = 2.0  # seconds after a signal until `leaving_at_once` ends the process

_asked = threading.Event()
_finishing: list[threading.Timer] = []  # the timers of the open `finishing` blocks, started by the first signal


@contextlib.contextmanager
def signals_stop() -> Iterator[None]:
    """In the block, SIGTERM (a batch system, a shutdown) acts like Ctrl-C: KeyboardInterrupt in the main thread.

    So does SIGHUP of a closed terminal, unless `nohup` made the command ignore it, and SIGBREAK, which Windows
    sends for Ctrl-Break and for a closed console.
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
    heard = [number for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN or number == signal.SIGINT]
    before = {number: signal.signal(number, stop) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _asked.clear()  # a later training in this process is not stopped


@contextlib.contextmanager
def finishing() -> Iterator[None]:
    """In the block, the first signal raises nothing for PATIENCE seconds; poll `stop_asked` there.

    After that time, or at a second signal, KeyboardInterrupt is raised.
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
    """Whether a signal has arrived in the present block of `signals_stop`."""
    return _asked.is_set()


@contextlib.contextmanager
def leaving_at_once(last_words: Callable[[], object], code: int) -> Iterator[None]:
    """In the block, a signal ends the process after LONGEST_WAIT even while compiled code, such as LLVM, runs.

    Python runs its handlers between two instructions of the main thread, of which none is executed while LLVM compiles.
    Here a thread waits for the number that the operating system's handler writes. Use it for work that leaves nothing
    behind; threads other than the main one run the block as it is.

    last_words   is called before the end
    code         exit code
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    written, read = socket.socketpair()
    written.setblocking(False)
    over = threading.Event()

    def watch() -> None:
        numbers = read.recv(1)
        if numbers and numbers[0] in SIGNALS and not over.wait(LONGEST_WAIT):
            last_words()
            os._exit(code)

    before = signal.set_wakeup_fd(written.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=watch, name="endotsr-stop", daemon=True).start()
    try:
        yield
    finally:
        over.set()
        signal.set_wakeup_fd(before)
        written.close()  # ends the thread
