"""The speed of this machine, remembered between trainings beside the compiled kernels.

A training stores its seconds per unit of work (`clips/sequences/forecast/work.py`) by its number of threads: of the
iterations if it timed at least LEAST_ITERATIONS, of the initial motion and of the evaluation; each on frames of at
least LEAST_PIXELS. Before the first training a few iterations can be timed. Forecasts read the speed; no result depends
on it.
"""

import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from endotsr.clips.sequences.forecast.seconds import MEASURED_SPEEDS, Beside, assumed_unit
from endotsr.errors import InputError
from endotsr.untrusted.json import number, read_json
from endotsr.untrusted.writing import replace_text

LEAST_ITERATIONS, LEAST_PIXELS = 200, 80_000
FASTEST, SLOWEST = 1e-4, 100.0  # seconds per unit; other numbers are no speed
ITERATIONS, START, EVALUATION = "seconds_per_unit", "start_seconds_per_unit", "evaluation_seconds_per_unit"

TRAINED = "at the speed of the last training"
TIMED = "at the speed of a few iterations"
ASSUMED = "the speed of this machine is assumed; machines took {:.1f} to {:.1f} times as long".format(*MEASURED_SPEEDS)


class KnownSpeed(NamedTuple):
    """What is known about the speed of a machine."""

    unit: float  # seconds per unit of work of an iteration, with the threads asked for
    beside: Beside
    source: str  # TRAINED, TIMED or ASSUMED


def known_speed(threads: int, timed: Callable[[], float] | None = None) -> KnownSpeed:
    """The speed in the last training with these threads; without one, as timed now, or an assumed one.

    timed   times a unit of work with these threads; None: too long for the command, or for the clip
    """
    unit, beside = remembered_unit(threads), remembered_beside(threads)
    if unit is not None:
        return KnownSpeed(unit, beside, TRAINED)
    return KnownSpeed(timed(), beside, TIMED) if timed else KnownSpeed(assumed_unit(threads), beside, ASSUMED)


def speed_file(threads: int) -> Path:
    """The file for a number of threads."""
    from endotsr.method.kernels.kernel_cache import kernel_folder

    return kernel_folder() / f"speed-{threads}.json"


def remembered_unit(threads: int) -> float | None:
    """Seconds per unit of work in the last training with these threads; None if unknown or unreadable."""
    return _remembered(threads).get(ITERATIONS)


def remembered_beside(threads: int) -> Beside:
    """Seconds per unit of the other parts in the last commands with these threads; None as in `remembered_unit`."""
    found = _remembered(threads)
    return Beside(found.get(START), found.get(EVALUATION))


def remember_unit(threads: int, unit: float | None, iterations: int, pixels: int) -> None:
    """Store the seconds per unit of work of a training, if it timed enough. A folder that refuses is ignored."""
    if iterations >= LEAST_ITERATIONS:
        _remember(threads, {ITERATIONS: unit}, pixels)


def remember_beside(threads: int, beside: Beside, pixels: int) -> None:
    """Store the seconds per unit of the other parts, as `remember_unit` does; None leaves the stored number."""
    _remember(threads, {START: beside.start, EVALUATION: beside.evaluation}, pixels)


def _remembered(threads: int) -> dict[str, float]:
    """The usable numbers of the file."""
    path, found = speed_file(threads), {}
    for key in (ITERATIONS, START, EVALUATION):
        with contextlib.suppress(InputError):
            found[key] = number(read_json(path).get(key), f"{path}: {key}", FASTEST, SLOWEST)
    return found


def _remember(threads: int, units: dict[str, float | None], pixels: int) -> None:
    """Replace these numbers of the file."""
    usable = {key: unit for key, unit in units.items() if unit is not None and FASTEST <= unit <= SLOWEST}
    if usable and pixels >= LEAST_PIXELS:
        with contextlib.suppress(OSError):
            replace_text(speed_file(threads), json.dumps(_remembered(threads) | usable))
