"""Medians and quartiles of repeated times. On a shared machine a mean would follow the largest disturbance."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np


def spread(seconds: Sequence[float]) -> dict[str, Any]:
    """{"median_ms", "quartiles_ms": [25 %, 75 %]} of times in seconds."""
    low, median, high = np.percentile(np.array(seconds) * 1e3, [25, 50, 75])
    return {"median_ms": float(median), "quartiles_ms": [float(low), float(high)]}


def repeated(work: Callable[[], object], repeats: int, warm_up: int = 1) -> list[float]:
    """Seconds of each of `repeats` calls, after `warm_up` calls that compile, load and touch memory."""
    seconds = []
    for repeat in range(-warm_up, repeats):
        began = time.perf_counter()
        work()
        if repeat >= 0:
            seconds.append(time.perf_counter() - began)
    return seconds
