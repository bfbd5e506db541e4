"""Means over seeds, formatted for the tables."""

from collections.abc import Sequence

import numpy as np


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Mean and half width of its 95 % interval (t distribution); nan for one value."""
    from scipy import stats

    n = len(values)
    if n < 2:
        return float(np.mean(values)), float("nan")
    return float(np.mean(values)), float(stats.t.ppf(0.975, n - 1) * stats.sem(values))


def shown(values: Sequence[float], digits: int, sign: str = "") -> str:
    """The mean with its 95 % interval; no interval for one value, a dash for none. sign = "+" shows the sign."""
    if not len(values):
        return "-"
    mean, half = interval(values)
    return f"{mean:{sign}.{digits}f}" + (f" ± {half:.{digits}f}" if len(values) > 1 else "")
