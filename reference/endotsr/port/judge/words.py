"""The integer generator: splitmix64, seeded by the FNV-1a hash of a text.

The 64-bit FNV-1a hash of the UTF-8 text is the seed. Number k (from 0) of a seed is the splitmix64 output
z = seed + (k + 1) 0x9E3779B97F4A7C15, z = (z ^ z >> 30) 0xBF58476D1CE4E5B9, z = (z ^ z >> 27) 0x94D049BB133111EB,
z ^ z >> 31, all modulo 2^64. These numbers generate the random inputs of the golden cases and the signs of
fingerprints.
"""

import numpy as np
from numpy.typing import NDArray

GAMMA, MIX_1, MIX_2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
FNV_START, FNV_PRIME = 0xCBF29CE484222325, 0x100000001B3
WORD = (1 << 64) - 1


def fnv1a(text: str) -> int:
    """64-bit FNV-1a hash of the UTF-8 bytes of a text."""
    value = FNV_START
    for byte in text.encode():
        value = ((value ^ byte) * FNV_PRIME) & WORD
    return value


def words(seed: int, count: int) -> NDArray[np.uint64]:
    """The first `count` numbers of splitmix64 from `seed`, taken modulo 2^64."""
    with np.errstate(over="ignore"):
        z = np.uint64(seed & WORD) + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(GAMMA)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(MIX_1)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(MIX_2)
        return z ^ (z >> np.uint64(31))


def unit_numbers(found: NDArray[np.uint64]) -> NDArray[np.float64]:
    """The top 24 bits of each word over 2^24: numbers in [0, 1), exact in float32."""
    return (found >> np.uint64(40)).astype(np.float64) / 2.0**24


def signs(seed: str, count: int) -> NDArray[np.float64]:
    """The signs in the fingerprints of outputs: +1 where the highest bit of a word of the text `seed` is 0, else -1."""
    return 1.0 - 2.0 * (words(fnv1a(seed), count) >> np.uint64(63)).astype(np.float64)
