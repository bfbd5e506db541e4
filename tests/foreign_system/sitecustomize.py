"""A foreign system for the package: what Windows lacks or does otherwise, in every process of a test run.

Python imports this file at its start where its folder stands in PYTHONPATH; `tests/foreign.py` puts it there. The
package, and no other code, then finds

- no `fcntl` and no `resource`, and an `os` and a `signal` without the names below; `os.name` is "nt";
- text files in cp1252 with CRLF, where encoding or line end are not stated;
- files that cannot be renamed, replaced or removed while this process has them open, and folders that cannot be opened;
- no gentle end of another process, and an invalid argument in place of a closed pipe.

Paths, and the locks of `filelock`, remain those of the real system. It needs /proc.
"""

import builtins
import errno
import io
import os
import shutil
import signal
import sys
import types
from pathlib import Path
from typing import Any

PACKAGE = "endotsr"
NO_MODULES = ("fcntl", "resource", "pwd", "grp", "termios")
NO_NAMES = {
    "os": {
        *("O_NONBLOCK", "O_NOFOLLOW", "O_CLOEXEC", "O_DIRECTORY", "O_SYNC", "fork", "register_at_fork", "setpgrp"),
        *("setsid", "killpg", "sched_getaffinity", "sysconf", "posix_fallocate", "mkfifo", "getuid", "geteuid"),
        *("statvfs", "uname", "getloadavg", "nice", "chown", "pread", "sync"),
    },
    "signal": {"SIGKILL", "SIGALRM", "SIGHUP", "SIGSTOP", "SIGPIPE", "SIGUSR1", "setitimer", "pthread_kill"},
    "sys": set(),
    "shutil": set(),
}
HELPERS = ("pathlib", "pathlib._local", "pathlib._abc", "tempfile", "io", "contextlib", __name__)
opened, imported = io.open, builtins.__import__


def name_of(scope: dict[str, Any]) -> str:
    """The module of a scope; that of `python -m` by its own name."""
    spec = scope.get("__spec__")
    return str(getattr(spec, "name", None) or scope.get("__name__") or "")


def belongs(name: str) -> bool:
    """Whether a module is one of the package."""
    return name.split(".")[0] == PACKAGE


def by_the_package() -> bool:
    """Whether code of the package made this call, through helpers of Python's library or not."""
    frame = sys._getframe(1)
    while frame is not None and name_of(frame.f_globals) in HELPERS:
        frame = frame.f_back
    return frame is not None and belongs(name_of(frame.f_globals))


class Foreign(types.ModuleType):
    """A module without some of its names; what is set here replaces the others."""

    def __init__(self, real: types.ModuleType, **other: Any) -> None:
        super().__init__(real.__name__)
        object.__getattribute__(self, "__dict__").update(_real=real, _other=other)

    def __getattribute__(self, name: str) -> Any:
        real, other = object.__getattribute__(self, "_real"), object.__getattribute__(self, "_other")
        if name in NO_NAMES[real.__name__]:
            raise AttributeError(f"module {real.__name__!r} has no attribute {name!r} on this system")
        return other[name] if name in other else getattr(real, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(object.__getattribute__(self, "_real"), name, value)


def refuse_shared(*paths: Any) -> None:
    """Raises PermissionError, as a sharing violation, if this process has one of the paths open or mapped."""
    held = set()
    for number in os.listdir("/proc/self/fd"):
        try:
            held.add(os.readlink(f"/proc/self/fd/{number}"))
        except OSError:
            continue
    with opened("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
        held |= {line.split(maxsplit=5)[5].strip() for line in maps if line.count(" /")}
    for path in paths:
        name = os.path.join(os.path.realpath(os.path.dirname(path) or "."), os.path.basename(path))
        if any(one == name or one.startswith(name + os.sep) for one in held):
            raise PermissionError(errno.EACCES, "The process cannot access the file because it is in use", str(path))


def checked(module: types.ModuleType, name: str, count: int) -> Any:
    """A function of the module whose first `count` arguments are paths that must not be in use."""

    def call(*words: Any, **more: Any) -> Any:
        refuse_shared(*words[:count])
        return getattr(module, name)(*words, **more)

    return call


def open_text(
    file: Any, mode: str = "r", buffering: int = -1, encoding: Any = None, errors: Any = None, newline: Any = None,
    closefd: bool = True, opener: Any = None,
) -> Any:  # fmt: skip
    """`open` with the defaults of Windows."""
    if "b" not in mode and by_the_package():
        encoding = "cp1252" if encoding in (None, "locale") else encoding
        newline = "\r\n" if newline is None and set(mode) & set("wax+") else newline
    return opened(file, mode, buffering, encoding, errors, newline, closefd, opener)


def open_descriptor(path: Any, *words: Any, **more: Any) -> int:
    """`os.open`, which opens no folder."""
    if os.path.isdir(path):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))
    return os.open(path, *words, **more)


class ClosedPipe(io.TextIOWrapper):
    """Standard output of Windows: a closed pipe is an invalid argument."""

    def write(self, text: str) -> int:
        """As a text file."""
        return self._told(lambda: super(ClosedPipe, self).write(text))

    def flush(self) -> None:
        """As a text file."""
        self._told(super().flush)

    def _told(self, act: Any) -> Any:
        try:
            return act()
        except BrokenPipeError:
            raise OSError(errno.EINVAL, "Invalid argument") from None


def end_by_force() -> None:
    """Processes of `multiprocessing` are killed where they are asked to end."""
    import multiprocessing.process as process

    process.BaseProcess.terminate = process.BaseProcess.kill  # type: ignore[method-assign]


PROXIES = {
    "os": Foreign(
        os,
        name="nt",
        open=open_descriptor,
        kill=lambda pid, number: os.kill(pid, signal.SIGKILL),
        **{name: checked(os, name, 2) for name in ("replace", "rename")},
        **{name: checked(os, name, 1) for name in ("unlink", "remove", "rmdir")},
    ),
    "signal": Foreign(signal),
    "sys": Foreign(sys, platform="win32"),
    "shutil": Foreign(shutil, rmtree=checked(shutil, "rmtree", 1)),
}


def import_foreign(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> Any:
    """`import`, which gives the package other modules."""
    if globals and level == 0 and belongs(name_of(globals)):
        if name in NO_MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name == "multiprocessing":
            end_by_force()
        if name in PROXIES:
            return PROXIES[name]
    return imported(name, globals, locals, fromlist, level)


def patched(name: str, count: int) -> None:
    """A method of Path that checks the paths that are in use, where the package calls it."""
    real = getattr(Path, name)

    def call(self: Path, *words: Any, **more: Any) -> Any:
        if by_the_package():
            refuse_shared(self, *words[: count - 1])
        return real(self, *words, **more)

    setattr(Path, name, call)


builtins.__import__ = import_foreign
builtins.open = io.open = open_text
for method, paths in (("unlink", 1), ("rmdir", 1), ("rename", 2), ("replace", 2)):
    patched(method, paths)
if any(PACKAGE in word for word in sys.orig_argv[1:4]) and sys.stdout is not None:
    sys.stdout = sys.__stdout__ = ClosedPipe(sys.stdout.detach(), encoding="cp1252", newline="\r\n")
