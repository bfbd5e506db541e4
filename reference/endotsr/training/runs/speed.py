"""The speed of this machine, remembered between trainings beside the compiled kernels.

A training stores its seconds per unit of work (`clips/sequences/checks/duration.py`) by its number of threads if it
timed at least LEAST_ITERATIONS on frames of at least LEAST_PIXELS. Forecasts read it; no result depends on it.
"""

import contextlib
import json
from pathlib import Path

from endotsr.errors import InputError
from endotsr.untrusted.json import number, read_json
from endotsr.untrusted.writing import replace_text

LEAST_ITERATIONS, LEAST_PIXELS = 200, 80_000
FASTEST, SLOWEST = 1e-4, 100.0  # seconds per unit; other numbers are no speed


def speed_file(threads: int) -> Path:
    """The file for a number of threads."""
    import numba

    from endotsr.method.kernels.jit import kernel_source_hash

    return Path(numba.config.CACHE_DIR) / f"speed-{kernel_source_hash()}-{threads}.json"  # type: ignore[attr-defined]


def remembered_unit(threads: int) -> float | None:
    """Seconds per unit of work in the last training with these threads; None if unknown or unreadable."""
    path = speed_file(threads)
    try:
        return number(read_json(path).get("seconds_per_unit"), f"{path}: seconds_per_unit", FASTEST, SLOWEST)
    except InputError:
        return None


def remember_unit(threads: int, unit: float | None, iterations: int, pixels: int) -> None:
    """Store the seconds per unit of work of a training, if it timed enough. A folder that refuses is ignored."""
    if unit is None or not FASTEST <= unit <= SLOWEST or iterations < LEAST_ITERATIONS or pixels < LEAST_PIXELS:
        return
    with contextlib.suppress(OSError):
        replace_text(speed_file(threads), json.dumps({"seconds_per_unit": unit}))
