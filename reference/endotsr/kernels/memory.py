"""How freed memory is kept: a training frees and asks for the same image-sized arrays in every iteration."""

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # of mallopt(3)


def keep_freed_memory() -> bool:
    """Let glibc reuse freed arrays instead of returning their pages to the system.

    Each return costs a page fault per 4 kB when the array is asked for again: 20 ms of an iteration at 640x512, and
    with a million Gaussians two seconds. So no array gets pages of its own, and the heap keeps what is freed.
    returns  whether the setting was taken; on other C libraries nothing happens
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(_M_MMAP_MAX, 0) and mallopt(_M_TRIM_THRESHOLD, 2**31 - 1))
