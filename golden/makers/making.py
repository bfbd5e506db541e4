"""A golden case before its answers are computed: inputs with their recipes, settings, and the mistakes it reveals.

Every array has its own seed, the text "family/case/array". The top 24 bits of a word of `judge.words`, over 2^24, are
a number in [0, 1). All real outputs are float32 numbers, so ports of either precision have equal inputs.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.words import fnv1a, words


class Made(NamedTuple):
    """An input array, its recipe, and its unit."""

    array: NDArray
    recipe: str
    unit: str = "1"


def single(values: NDArray | float | list) -> NDArray[np.float64]:
    """The values rounded to float32, as float64."""
    return np.asarray(values, np.float64).astype(np.float32).astype(np.float64)


def uniform(seed: str, low: float, high: float, shape: tuple[int, ...], unit: str = "1") -> Made:
    """low + (high - low) u in C order, computed in double precision and rounded to float32."""
    u = (words(fnv1a(seed), int(np.prod(shape))) >> np.uint64(40)).astype(np.float64) / 2.0**24
    return Made(single(low + (high - low) * u).reshape(shape), f"uniform({low!r}, {high!r}) seed {seed}", unit)


def permutation(seed: str, count: int) -> NDArray[np.intp]:
    """Stable order of the first `count` words of a seed."""
    return np.argsort(words(fnv1a(seed), count), kind="stable")


def given(values: NDArray | float | list, recipe: str, unit: str = "1") -> Made:
    """Values from a closed formula or a list; reals are rounded to float32, other kinds kept."""
    array = np.asarray(values)
    return Made(single(array) if array.dtype.kind == "f" else array, recipe, unit)


def scalar(value: float) -> Made:
    """A number as an array without axes."""
    return given(np.array(value), repr(value))


def changed(made: Made, index: object, values: NDArray | float | list, recipe: str) -> Made:
    """A copy with some entries replaced, as described by the recipe."""
    array = made.array.copy()
    array[index] = single(values) if array.dtype.kind == "f" else values  # type: ignore[index]
    return Made(array, f"{made.recipe}; then {recipe}", made.unit)


class Spec(NamedTuple):
    """A case without its answers."""

    family: str
    case: str
    operation: str
    title: str
    flags: tuple[str, ...]
    settings: dict[str, Any]
    inputs: dict[str, Made]
    still: tuple[str, ...] = ()  # inputs that are at a tie or kink: not perturbed when spreads are measured
    without: tuple[str, ...] = ()  # outputs that this case does not request
    flip_budget: int = 0  # pixels of an image that may flip, for a case that is on the cutoff
    own: tuple[str, ...] = ()  # outputs for which the oracle has no answer here: the truth is the reference
    either: tuple[dict[str, Any], ...] = ()  # settings with which the reference gives the other legal answers

    @property
    def name(self) -> str:
        """family/case"""
        return f"{self.family}/{self.case}"


class Seeds:
    """Uniform arrays of one case, each under its own seed "family/case/array"."""

    def __init__(self, family: str, case: str) -> None:
        self.name = f"{family}/{case}"

    def seed(self, array: str) -> str:
        """The seed text of an array."""
        return f"{self.name}/{array}"

    def uniform(self, array: str, low: float, high: float, *shape: int, unit: str = "1") -> Made:
        """See `uniform`."""
        return uniform(self.seed(array), low, high, shape, unit)
