"""Properties of this machine: cores and memory."""

import os
from pathlib import Path

CGROUP_OF_PROCESS = "/proc/self/cgroup"
# Versions 2 and 1. By the controllers that a line of this file names: where the groups are, and the file of the limit.
CGROUPS = {"": ("/sys/fs/cgroup", "memory.max"), "memory": ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")}
NO_LIMIT = 1 << 62  # version 1 writes a number near 2^63 instead of `max`


def usable_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory_of_machine() -> int | None:
    """Bytes of memory of this machine, at most the limit of its container; None if the system does not report it."""
    return min((value for value in (_memory("total"), container_limit()) if value is not None), default=None)


def memory_available() -> int | None:
    """Bytes available to programs without swapping, at most the limit of a container; None if not reported."""
    return min((value for value in (_memory("available"), container_limit()) if value is not None), default=None)


def container_limit() -> int | None:
    """The least limit of memory, bytes, of the control groups of this process; None without one."""
    files = [Path(top, file) for top, file in CGROUPS.values()]
    try:
        words = [line.split(":", 2) for line in Path(CGROUP_OF_PROCESS).read_text(encoding="utf-8").splitlines()]
    except (OSError, UnicodeError):
        words = []
    for _, controllers, place in (word for word in words if len(word) == 3):
        top, file = CGROUPS.get(controllers, (None, ""))
        if top is not None:
            folder = Path(top, place.strip("/"))
            files += [part / file for part in (folder, *folder.parents) if part.is_relative_to(top)]
    found = []
    for file in files:
        try:
            found.append(int(file.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no such file, or the word `max`
            continue
    return min((value for value in found if value < NO_LIMIT), default=None)


def _memory(kind: str) -> int | None:
    import psutil

    try:
        return getattr(psutil.virtual_memory(), kind)
    except (psutil.Error, NotImplementedError, OSError, RuntimeError):  # for example, no /proc
        return None
