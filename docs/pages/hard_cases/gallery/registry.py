"""What a case of the gallery is, and the list of all."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

DTYPES = {"float64": np.float64, "float32": np.float32}


class Case(NamedTuple):
    """A hard case; `run(dtype)` computes (truth, naive, ours) from the same inputs, rounded to that precision."""

    name: str  # as in the catalogue
    title: str
    naive: str  # the formula that `run` executes
    why: str
    bound: float  # largest error of ours, in roundings (2^-53 or 2^-24)
    run: Callable[[Any], tuple[Any, Any, Any]]


CASES: list[Case] = []


def case(name: str, title: str, *, naive: str, why: str, bound: float):
    """Put a function into the gallery."""

    def register(run: Callable[[Any], tuple[Any, Any, Any]]):
        CASES.append(Case(name, title, naive, why, bound, run))
        return run

    return register
