"""Distances between arrays in units of a scale, and rules for them; also used to generate the vectors."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.format import FLIP_BUDGET, LEVELS, Rule
from endotsr.port.judge.words import signs

COLUMN_FLOOR = 1e-3  # smallest scale of a slice under "last", relative to the largest magnitude


class Verdict(NamedTuple):
    """Outcome for one output."""

    passed: bool
    reason: str
    distance: float | None = None  # largest, in units of the scale; None = not a number
    worst: tuple[int, ...] = ()
    got: float = 0.0
    expected: float = 0.0


def scale_of(expected: NDArray, kind: str) -> NDArray | float:
    """The unit of a difference; 1 if everything expected is 0."""
    size = np.abs(expected.astype(np.float64))
    largest = float(size.max()) if size.size else 0.0
    if largest == 0.0:
        return 1.0
    if kind == "last" and expected.ndim > 1:
        columns = size.reshape(-1, size.shape[-1]).max(axis=0)
        return np.maximum(columns, COLUMN_FLOOR * largest)
    return largest


def distances(got: NDArray, expected: NDArray, kind: str) -> NDArray:
    """|got - expected| / scale, infinite if `got` is not finite or the shape differs."""
    if got.shape != expected.shape:
        return np.array([np.inf])
    with np.errstate(all="ignore"):
        off = np.abs(got.astype(np.float64) - expected.astype(np.float64)) / scale_of(expected, kind)
    return np.where(np.isfinite(off), off, np.inf)


def largest(got: NDArray, expected: NDArray, kind: str) -> float:
    """The largest distance; 0 for empty arrays of one shape."""
    off = distances(got, expected, kind)
    return float(off.max()) if off.size else 0.0


def fingerprint(name: str, array: NDArray) -> float:
    """Sum of the entries in C order with the signs of the seed `name`.

    If entries are not finite, these count as 1 and all others as 0.
    """
    flat = array.reshape(-1).astype(np.float64)
    broken = ~np.isfinite(flat)
    with np.errstate(all="ignore"):  # a sum that overflows agrees with no mistake
        return float((signs(name, array.size) * (broken if broken.any() else flat)).sum())


def judged(got: NDArray, expected: NDArray, rule: Rule, precision: str, order: str = "") -> Verdict:
    """The verdict on an output of the right shape and kind.

    order   "iteration": a refusal reports the first wrong entry, otherwise the worst
    """
    if rule.kind == "exact":
        unequal = np.argwhere(got != expected)
        if len(unequal):
            return _refusal(f"{len(unequal)} of {expected.size} entries differ", got, expected, unequal[0], 1.0)
        return Verdict(True, "equal", 0.0)
    tolerance = rule.float64 if precision == "float64" else rule.float32
    off = distances(got, expected, rule.scale)
    if not off.size:
        return Verdict(True, "empty", 0.0)
    found = float(off.max())
    wrong = off > tolerance
    beyond = int(wrong.sum())
    worst = np.unravel_index(int(wrong.argmax() if order else off.argmax()), off.shape)
    if beyond == 0:
        return Verdict(True, f"{found:.1e} <= {tolerance:.0e}", found)
    if not np.isfinite(found):
        return _refusal("not finite", got, expected, worst, None)
    if rule.kind == FLIP_BUDGET:
        if beyond <= rule.flips and found <= rule.flip_size:
            return Verdict(True, f"{beyond} of {rule.flips} flips", found)
        return _refusal(f"{beyond} entries beyond {tolerance:.0e}, {rule.flips} may flip by {rule.flip_size:.0e}",
                        got, expected, worst, found)  # fmt: skip
    times = f", {found / tolerance:.2g} times what is allowed" if tolerance > 0 else ""
    return _refusal(f"{found:.1e} > {tolerance:.0e} of scale{times}, {beyond} entries", got, expected, worst, found)


def misses(verdicts: Iterable[tuple[int, bool]]) -> tuple[int, ...]:
    """Numbers of failed outputs by level, from (level, passed); the smallest selects the answer of a port."""
    counts = [0] * len(LEVELS)
    for level, passed in verdicts:
        counts[level] += not passed
    return tuple(counts)


def _refusal(reason: str, got: NDArray, expected: NDArray, worst, distance: float | None) -> Verdict:
    index = tuple(int(k) for k in worst)
    at = tuple(index)
    return Verdict(False, reason, distance, index, float(got[at]), float(expected[at]))
