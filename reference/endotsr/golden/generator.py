"""The written-out integer generator behind the inputs of the golden cases, and closed formulas beside it.

Every array has its own seed, the 64-bit FNV-1a hash of the UTF-8 text "family/case/array" (a draw number may follow).
Number k (from 0) of a seed is splitmix64: z = seed + (k + 1) 0x9E3779B97F4A7C15, z = (z ^ z >> 30) 0xBF58476D1CE4E5B9,
z = (z ^ z >> 27) 0x94D049BB133111EB, z ^ z >> 31, all modulo 2^64. Its top 24 bits over 2^24 are a number in [0, 1).

Every real number that leaves this module is a float32 number, so that ports of either precision start from the same.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GAMMA, MIX_1, MIX_2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
FNV_START, FNV_PRIME = 0xCBF29CE484222325, 0x100000001B3
WORD = (1 << 64) - 1


class Made(NamedTuple):
    """An input array, how it was made, and its unit."""

    array: NDArray
    recipe: str
    unit: str = "1"


def fnv1a(text: str) -> int:
    """64-bit FNV-1a hash of the UTF-8 bytes of a text."""
    value = FNV_START
    for byte in text.encode():
        value = ((value ^ byte) * FNV_PRIME) & WORD
    return value


def words(seed: int, count: int) -> NDArray[np.uint64]:
    """The first `count` numbers of splitmix64 from `seed`."""
    with np.errstate(over="ignore"):
        z = np.uint64(seed & WORD) + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(GAMMA)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(MIX_1)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(MIX_2)
        return z ^ (z >> np.uint64(31))


def single(values: NDArray | float | list) -> NDArray[np.float64]:
    """The values rounded to float32, held in float64."""
    return np.asarray(values, np.float64).astype(np.float32).astype(np.float64)


def uniform(seed: str, low: float, high: float, shape: tuple[int, ...], unit: str = "1") -> Made:
    """low + (high - low) u in C order, computed in double precision and rounded to float32."""
    u = (words(fnv1a(seed), int(np.prod(shape))) >> np.uint64(40)).astype(np.float64) / 2.0**24
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
