"""Reuse of freed memory: every training iteration frees and allocates the same image-sized arrays."""

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # of mallopt(3)


def keep_freed_memory() -> bool:
    """Let glibc reuse freed arrays instead of returning their pages to the system.

    A returned page costs a page fault when it is allocated again, one per 4 kB: 20 ms of an iteration at 640x512, and
    two seconds with a million Gaussians. Therefore no array is mapped separately, and the heap keeps what is freed.
    returns  whether the setting was accepted; on other C libraries nothing changes
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(_M_MMAP_MAX, 0) and mallopt(_M_TRIM_THRESHOLD, 2**31 - 1))
