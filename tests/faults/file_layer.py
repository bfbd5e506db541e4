"""A file layer that fails or kills at a chosen operation: every write, rename, link, flush and removal is counted.

    with operations(below=folder, at=17, act=disk_full) as layer: ...

Only files below the folder count. `layer.count` is the number of operations so far; without `at` they are only counted.
"""

import builtins
import errno
import io
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CALLS = ("replace", "rename", "link", "mkdir", "rmdir", "unlink", "truncate")  # of os; the first argument is a path


def disk_full(path: object) -> None:
    """No space left on the device."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def read_only(path: object) -> None:
    """A file system that was mounted anew as read-only."""
    raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))


def killed(path: object) -> None:
    """SIGKILL of this process: no handler and no `finally` runs."""
    os.kill(os.getpid(), signal.SIGKILL)


class Layer:
    """Counts operations, and acts at one of them or, with `onwards`, at all from there."""

    def __init__(self, below: Path, at: int | None, act: Callable[[object], None], onwards: bool) -> None:
        self.below, self.at, self.act, self.onwards = str(below.resolve()), at, act, onwards
        self.count = 0

    def tell(self, path: object, *, removes: bool = False) -> None:
        """One operation on a path; on a full disk files can still be removed."""
        if removes and self.act is disk_full:
            return
        if isinstance(path, str | os.PathLike) and os.path.abspath(path).startswith(self.below + os.sep):
            self.count += 1
            if self.at is not None and (self.count == self.at or (self.onwards and self.count > self.at)):
                self.act(path)


class _Watched:
    """An open file whose writes are counted."""

    def __init__(self, file: Any, path: object, layer: Layer) -> None:
        self._file, self._path, self._layer = file, path, layer

    def write(self, data: Any) -> int:
        if self._layer.act is not disk_full:
            self._layer.tell(self._path)
            return self._file.write(data)
        before = self._layer.count
        try:
            self._layer.tell(self._path)
        except OSError:
            self._file.write(data[: len(data) // 2])  # what still fits is written
            self._file.flush()
            assert before < self._layer.count
            raise
        return self._file.write(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __iter__(self) -> Any:
        return iter(self._file)

    def __enter__(self) -> "_Watched":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


@contextmanager
def operations(
    below: Path, at: int | None = None, act: Callable[[object], None] = disk_full, *, onwards: bool = False
) -> Iterator[Layer]:
    """The layer, in place for the block."""
    layer = Layer(below, at, act, onwards)
    opened, fsync = io.open, os.fsync
    calls = {name: getattr(os, name) for name in CALLS}

    def watched_open(path: Any, mode: str = "r", *words: Any, **more: Any) -> Any:
        if not set(mode) & set("wax+"):
            return opened(path, mode, *words, **more)
        layer.tell(path)
        return _Watched(opened(path, mode, *words, **more), path, layer)

    def watched_call(name: str) -> Callable[..., Any]:
        def call(path: Any, *words: Any, **more: Any) -> Any:
            layer.tell(path, removes=name in ("unlink", "rmdir"))
            return calls[name](path, *words, **more)

        return call

    def watched_fsync(descriptor: int) -> None:
        layer.tell(os.path.join(layer.below, "flushed"))
        fsync(descriptor)

    try:
        builtins.open = io.open = watched_open
        os.fsync = watched_fsync
        for name in CALLS:
            setattr(os, name, watched_call(name))
        yield layer
    finally:
        builtins.open = io.open = opened
        os.fsync = fsync
        for name, call in calls.items():
            setattr(os, name, call)
