"""Opening and reading of files that another program or person made, and renaming where another program reads.

Only regular files are opened: a named pipe would block the command for ever, and a device may never end. Reading is
bounded by a size that the caller states. It happens in the calling thread, or in threads that do not keep the process
alive (`in_threads`), so that Ctrl-C ends a command while a file system does not answer.
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
PATIENCE = 2.0  # seconds that a file which another program has open is waited for, on Windows
MOST_READERS = 8  # threads that read files at the same time
KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def open_regular(path: Path, largest: int) -> io.BufferedReader:
    """A regular file, opened for reading as bytes; a link to one is followed.

    largest   bytes that the file may have

    Raises: InputError if there is none, if it is a pipe, a socket, a device or a folder, or if it is larger.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    try:
        _check_regular(path, os.stat(path).st_mode)  # before opening: the opening alone can change a device
        descriptor = os.open(path, flags)
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    file = os.fdopen(descriptor, "rb")
    try:
        status = os.fstat(descriptor)
        _check_regular(path, status.st_mode)
        if status.st_size > largest:
            raise InputError(f"{path}: has {status.st_size} bytes; allowed: at most {largest}")
    except BaseException:
        file.close()
        raise
    return file


def read_bytes(path: Path, largest: int) -> bytes:
    """The content of a regular file. Raises InputError as `open_regular` does, and if the file cannot be read."""
    with open_regular(path, largest) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            data = file.read(size + 1)  # no more memory than the file needs
        except OSError as error:
            raise _refusal(path, error) from None
    if len(data) > size:
        raise InputError(f"{path}: grew while it was read; allowed: a file that nobody is writing")
    return data


def read_text(path: Path, largest: int = LARGEST_TEXT) -> str:
    """The content of a regular file as UTF-8; a byte-order mark at its start is left out.

    Raises: InputError as `read_bytes` does, and if the bytes are not UTF-8.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read: not UTF-8 text: byte {error.start}") from None


def rename(source: Path, target: Path) -> None:
    """Put a file or folder in the place of another, as `os.replace`.

    Windows refuses that while a program has one of the two open, a virus scanner or a viewer say: it is tried again.
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
        raise InputError(f"{path}: cannot be read: it is {kind}; allowed: a regular file")


def _refusal(path: Path, error: OSError | ValueError) -> InputError:
    """InputError for an error of the file system, or for a path that holds a zero byte (ValueError)."""
    if isinstance(error, InputError):
        return error
    return InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}")


def in_threads(work: Callable[[int], object], count: int) -> None:
    """Call work(0) ... work(count - 1) in several threads and wait for all of them.

    The threads end with the process: KeyboardInterrupt leaves them behind, whatever they wait for.
    Raises: the error of the smallest index that raised one, after all calls have ended.
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
