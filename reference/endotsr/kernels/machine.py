"""What this machine offers to a computation: its cores and its memory."""

import os


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
