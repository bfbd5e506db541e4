"""Opening and reading files of unknown origin, and renaming files that another program may be reading.

Only regular files are opened: a named pipe would block the command indefinitely, and a device may never end. The caller
limits the size. Reading happens in the calling thread or in daemon threads (`in_threads`): Ctrl-C does not wait for a
daemon thread whose file system does not respond.
"""

import io
import os
import stat
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue

from endotsr.errors import InputError

LARGEST_TEXT = 1 << 26  # bytes of a settings or record file: 64 MiB
MOST_PIXELS = 1 << 26  # of a picture: 8192 x 8192
PATIENCE = 2.0  # seconds to wait for a file that another program has open, on Windows
MOST_READERS = 8  # concurrent reader threads
KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def open_regular(path: Path, largest: int) -> io.BufferedReader:
    """A regular file, opened for reading bytes. Links are followed.

    largest   size limit, bytes

    Raises: InputError for a missing file, a pipe, a socket, a device, a folder, or a file over the limit.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    try:
        _check_regular(path, os.stat(path).st_mode)  # before opening: opening alone can change a device
        descriptor = os.open(path, flags)
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    file = os.fdopen(descriptor, "rb")
    try:
        status = os.fstat(descriptor)
        _check_regular(path, status.st_mode)
        if status.st_size > largest:
            raise InputError(f"{path}: has {status.st_size} bytes; use at most {largest}")
    except BaseException:
        file.close()
        raise
    return file


def read_bytes(path: Path, largest: int) -> bytes:
    """The content of a regular file. Raises InputError as `open_regular` does, and if the file cannot be read."""
    with open_regular(path, largest) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            data = file.read(size + 1)  # allocates one byte more than the file size
        except OSError as error:
            raise _refusal(path, error) from None
    if len(data) > size:
        raise InputError(f"{path}: grew while it was read; use a file that is not being written")
    return data


def read_text(path: Path, largest: int = LARGEST_TEXT) -> str:
    """The content of a regular UTF-8 file, without a byte-order mark.

    Raises: InputError as `read_bytes` does, and if the bytes are not UTF-8.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read: not UTF-8 text: byte {error.start}") from None


def rename(source: Path, target: Path) -> None:
    """Rename a file or folder, replacing the target, as `os.replace`.

    Windows refuses while another program, such as a virus scanner, has either one open. The call is then retried for
    `PATIENCE` seconds.
    Raises: OSError of the file system.
    """
    ends = time.monotonic() + (PATIENCE if os.name == "nt" else 0.0)
    while True:
        try:
            return os.replace(source, target)
        except PermissionError:
            if time.monotonic() >= ends:
                raise
            time.sleep(0.02)


def _check_regular(path: Path, mode: int) -> None:
    if not stat.S_ISREG(mode):
        kind = KINDS.get(stat.S_IFMT(mode), "a special file")
        raise InputError(f"{path}: cannot be read: it is {kind}; use a regular file")


def _refusal(path: Path, error: OSError | ValueError) -> InputError:
    """InputError for a file-system error, or for a path with a zero byte (ValueError)."""
    if isinstance(error, InputError):
        return error
    return InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}")


def in_threads(work: Callable[[int], object], count: int) -> None:
    """Call work(0) ... work(count - 1) in several threads and wait for all calls.

    The threads are daemons: KeyboardInterrupt does not wait for them.
    Raises: the error with the smallest index, after all calls have ended.
    """
    todo: Iterator[int] = iter(range(count))  # of a range: `next` is atomic
    done: SimpleQueue[tuple[int, BaseException | None]] = SimpleQueue()

    def serve() -> None:
        for index in todo:
            try:
                work(index)
                done.put((index, None))
            except BaseException as error:
                done.put((index, error))

    for _ in range(min(MOST_READERS, count, (os.cpu_count() or 1) + 2)):
        threading.Thread(target=serve, name="endotsr-reader", daemon=True).start()
    failed = {index: error for index, error in (done.get() for _ in range(count)) if error is not None}
    if failed:
        raise failed[min(failed)]
