"""Properties of this machine: cores, memory, and the compile target, which affects the last bits of results."""

import hashlib
import os
import platform


def usable_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiled_for() -> str:
    """The compile target of kernels, a string without spaces: everything that can change a rounding.

    On Linux with glibc and without variables of Numba it is the processor name. Another system, whose C library has
    other `exp` and `log`, and a digest of NUMBA_CPU_FEATURES are appended.
    """
    import numba
    from llvmlite.binding import get_host_cpu_name

    name, features = numba.config.CPU_NAME, numba.config.CPU_FEATURES  # type: ignore[attr-defined]
    words = [name or get_host_cpu_name()]
    if not (platform.system() == "Linux" and platform.libc_ver()[0] == "glibc"):
        words.append(platform.system().lower())
    if features is not None:
        words.append("features" + hashlib.sha256(features.encode()).hexdigest()[:8])
    return "-".join(words)


def memory_of_machine() -> int | None:
    """Bytes of memory of this machine; None if the system does not report it."""
    return _memory("total")


def memory_available() -> int | None:
    """Bytes available to programs without swapping; None if the system does not report it."""
    return _memory("available")


def _memory(kind: str) -> int | None:
    import psutil

    try:
        return getattr(psutil.virtual_memory(), kind)
    except (psutil.Error, NotImplementedError, OSError, RuntimeError):  # for example, no /proc
        return None
