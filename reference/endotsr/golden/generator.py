"""Input arrays of the golden cases: drawn by the written-out generator, or from closed formulas.

Every real number that leaves this module is a float32 number, so that ports of either precision start from the same.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.stages.words import fnv1a, unit_numbers, words


class Made(NamedTuple):
    """An input array, how it was made, and its unit."""

    array: NDArray
    recipe: str
    unit: str = "1"


def single(values: NDArray | float | list) -> NDArray[np.float64]:
    """The values rounded to float32, held in float64."""
    return np.asarray(values, np.float64).astype(np.float32).astype(np.float64)


def uniform(seed: str, low: float, high: float, shape: tuple[int, ...], unit: str = "1") -> Made:
    """low + (high - low) u in C order, computed in double precision and rounded to float32."""
    u = unit_numbers(words(fnv1a(seed), int(np.prod(shape))))
    return Made(single(low + (high - low) * u).reshape(shape), f"uniform({low!r}, {high!r}) seed {seed}", unit)


def permutation(seed: str, count: int) -> NDArray[np.intp]:
    """Stable order of the first `count` words of a seed."""
    return np.argsort(words(fnv1a(seed), count), kind="stable")


def signs(seed: str, count: int) -> NDArray[np.float64]:
    """+1 or -1 from the highest bit of the words of a seed; what the fingerprints of outputs are summed with."""
    return 1.0 - 2.0 * (words(fnv1a(seed), count) >> np.uint64(63)).astype(np.float64)


def given(values: NDArray | float | list, recipe: str, unit: str = "1") -> Made:
    """Values from a closed formula or written down; reals are rounded to float32, other kinds kept."""
    array = np.asarray(values)
    return Made(single(array) if array.dtype.kind == "f" else array, recipe, unit)


def changed(made: Made, index: object, values: NDArray | float | list, recipe: str) -> Made:
    """A copy with some entries replaced; the recipe says which."""
    array = made.array.copy()
    array[index] = single(values) if array.dtype.kind == "f" else values  # type: ignore[index]
    return Made(array, f"{made.recipe}; then {recipe}", made.unit)
