"""The number of threads of a command."""

import os

from endotsr.errors import InputError


def use_threads(asked: int) -> int:
    """Let compiled kernels use `asked` threads (0 = all cores), which changes no result; returns the number.

    More than Numba has started, one a core, means all of them. Raises InputError for a number below 0.
    """
    if asked < 0:
        raise InputError(f"--threads {asked} is not allowed; allowed: 0 (all cores) or more")

    import numba

    most = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    used = min(asked or len_cores(), most)
    numba.set_num_threads(used)
    return used


def len_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
