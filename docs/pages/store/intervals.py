"""Means over seeds, formatted for the tables."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95  # of every interval
Interval = tuple[float, float] | None
Values = Sequence[float] | NDArray[np.float64]


def interval(values: Values) -> tuple[float, float]:
    """Mean and half width of its 95 % interval (t distribution); nan for one value."""
    from scipy import stats

    n = len(values)
    if n < 2:
        return float(np.mean(values)), float("nan")
    return float(np.mean(values)), float(stats.t.ppf((1 + LEVEL) / 2, n - 1) * stats.sem(values))


def student(values: Values) -> tuple[float, Interval]:
    """Mean and limits of its interval; no limits for one value."""
    mean, half = interval(values)
    return mean, None if len(values) < 2 else (mean - half, mean + half)


def blocks(values: Values, frames: Sequence[int]) -> list[float]:
    """The mean of the values of every block of successive frames."""
    ends = np.flatnonzero(np.diff(frames) > 1) + 1
    return [float(np.mean(part)) for part in np.split(np.asarray(values), ends)]


def paired(values: Values, frames: Sequence[int], digits: int) -> str:
    """Differences by frame: their mean with an interval, or the mean of each block where frames follow each other.

    The frames of a block are too alike for an interval, and the blocks of a clip are few.
    """
    found = blocks(values, frames)
    if len(found) == len(values):
        return shown(values, digits, "+")
    return ", ".join(f"{value:+.{digits}f}" for value in found)


def shown(values: Values, digits: int, sign: str = "") -> str:
    """The mean with its 95 % interval; no interval for one value, a dash for none. sign = "+" shows the sign."""
    if not len(values):
        return "-"
    mean, half = interval(values)
    return f"{mean:{sign}.{digits}f}" + (f" ± {half:.{digits}f}" if len(values) > 1 else "")
