"""Frequencies and frame times as inputs, for every family that depends on time."""

import numpy as np

from endotsr.method.equations.dictionary import frequencies
from makers.making import Made, given


def omegas(count: int, high: float = 16.0) -> Made:
    """Frequencies as an input, rounded to float32: the case does not depend on their computation."""
    return given(frequencies(count, 1.0, high), f"1 * {high!r}^(k / {count - 1}), rounded", "cycles per sequence")


def stamps(count: int) -> Made:
    """k / n of all frames."""
    return given(np.arange(count) / count, f"k / {count}")


def train_index(count: int) -> Made:
    """All frames except (k - 1) % 8 == 0."""
    keep = np.flatnonzero((np.arange(count) - 1) % 8 != 0)
    return given(keep, "all k but (k - 1) % 8 == 0", "frame")
