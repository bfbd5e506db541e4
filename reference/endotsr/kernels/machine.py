"""What this machine offers to a computation: its cores, its memory, and what decides the last bits of its results."""

import hashlib
import os
import platform


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiled_for() -> str:
    """What kernels are compiled for, as words without spaces: processor, and what else can change a rounding.

    It is the name of the processor alone on Linux with glibc, without the variables of Numba. Otherwise the system,
    whose C library has other functions `exp` and `log`, and a digest of NUMBA_CPU_FEATURES follow.
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
    """Bytes of memory of this machine; None where the system does not say."""
    return _memory("total")


def memory_available() -> int | None:
    """Bytes that programs can still take without swapping; None where the system does not say."""
    return _memory("available")


def _memory(kind: str) -> int | None:
    import psutil

    try:
        return getattr(psutil.virtual_memory(), kind)
    except (psutil.Error, NotImplementedError, OSError, RuntimeError):  # a system without /proc, say
        return None
