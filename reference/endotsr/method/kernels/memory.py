"""Memory: reuse of freed arrays, the memory limit of a clip, and a cache with a limit."""

import ctypes
import sys
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from endotsr.method.kernels.machine import memory_of_machine

Key = TypeVar("Key")
Value = TypeVar("Value")

ASSUMED = 4e9  # bytes of memory assumed if the system does not report its amount
_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # of mallopt(3)


def keep_freed_memory() -> bool:
    """Let glibc reuse freed arrays instead of returning their pages to the system.

    Reallocating returned memory costs a page fault for each page. Therefore no array is mapped separately, and the
    heap retains freed memory.
    returns  whether the setting was accepted; other C libraries are left unchanged
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(_M_MMAP_MAX, 0) and mallopt(_M_TRIM_THRESHOLD, 2**31 - 1))


def memory_limit(gigabytes: float) -> float:
    """Memory limit, in bytes, of the frames of a clip and everything computed from them.

    gigabytes   `sequence.memory`; 0 = half of this machine's memory, or of ASSUMED if that is unknown
    """
    return gigabytes * 1e9 if gigabytes > 0 else (memory_of_machine() or ASSUMED) / 2


def unknown_memory() -> str:
    """A note on the assumed amount of memory; "" if the system reports the amount."""
    return "" if memory_of_machine() else f"the system does not report its memory: {ASSUMED / 1e9:g} GB assumed"


def bytes_of(value: object) -> int:
    """Bytes of the arrays in nested tuples, lists and dictionaries; an array that occurs twice counts once."""
    found: dict[int, int] = {}

    def collect(part: object) -> None:
        if isinstance(part, np.ndarray):
            found[id(part)] = part.nbytes
        elif isinstance(part, tuple | list | dict):
            for inner in part.values() if isinstance(part, dict) else part:
                collect(inner)

    collect(value)
    return sum(found.values())


class Kept(Generic[Key, Value]):
    """A cache of computed values by key, for several threads. Beyond `limit` bytes, the oldest values are dropped.

    A dropped value is recomputed on request, and two threads may compute the same one at the same time. A value must
    therefore be a function of its key, to the bit; neither the limit nor the threads change a result.
    """

    def __init__(self, limit: float = np.inf) -> None:
        self.limit, self.bytes = limit, 0
        self._values: dict[Key, Value] = {}
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, key: Key) -> bool:
        return key in self._values

    def __getitem__(self, key: Key) -> Value:
        return self._values[key]

    def put(self, key: Key, value: Value) -> None:
        """Store a value. The newest value is kept even if it exceeds the limit."""
        with self._lock:
            self._put(key, value)

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """The value of a key, computed at first use, without the lock."""
        with self._lock:
            if key in self._values:
                return self._values[key]
        made = make()
        with self._lock:
            if key not in self._values:
                self._put(key, made)
            return self._values[key]

    def _put(self, key: Key, value: Value) -> None:
        self._values[key] = value
        self.bytes += bytes_of(value)
        while self.bytes > self.limit and len(self._values) > 1:
            self.bytes -= bytes_of(self._values.pop(next(iter(self._values))))
