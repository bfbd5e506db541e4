"""The registry of forward/reverse pairs: gradient checks, golden cases and the equation table are driven from it.

A pair cannot exist unchecked: `tests/test_conventions.py` asserts that every `<stage>_forward` of the package
is named by a pair that `all_pairs` returns.
"""

import contextlib
import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError

Arrays = Mapping[str, NDArray]

PAIR_MODULES = (
    "pairs_equations",
    "pairs_deformation",
    "pairs_splatting",
    "pairs_losses",
    "pairs_exposure",
    "pairs_chain",
)


class Pair(NamedTuple):
    """One forward pass and its reverse pass, wrapped so that a checker needs to know nothing about them.

    name      stage name, with its variant where there are several
    equation  the equation label of the specification ("1" ... "7" for the paper, "B..." for the base model)
    inputs    rng -> float64 arrays; every one of them is differentiable; non-vacuous and away from kinks
    forward   inputs -> outputs, by name; float arrays (a scalar loss is an array of shape ())
    reverse   (inputs, cotangents by output name) -> gradients by input name
    blocks    inputs -> (input name, boolean mask or slice) by block name: what is probed separately;
              None = one block per input array
    trace     inputs -> integer arrays: the discrete decisions (order, contributors, clamps) of the forward
              pass; a finite difference whose two ends differ in it is refused. None = no decisions
    function  dotted name of the forward function, for tables
    hard      inputs -> flat indices by input name: entries that are always probed one by one
    single    "" = the pair also runs in float32; otherwise the reason why it cannot
    """

    name: str
    equation: str
    function: str
    inputs: Callable[[np.random.Generator], dict[str, NDArray]]
    forward: Callable[[Arrays], Mapping[str, NDArray]]
    reverse: Callable[[Arrays, Arrays], Mapping[str, NDArray]]
    blocks: Callable[[Arrays], Mapping[str, tuple[str, object]]] | None = None
    trace: Callable[[Arrays], Mapping[str, NDArray]] | None = None
    hard: Callable[[Arrays], Mapping[str, NDArray]] | None = None
    single: str = ""


def all_pairs() -> dict[str, Pair]:
    """Every registered pair by name, in the order of the specification."""
    found: dict[str, Pair] = {}
    for name in PAIR_MODULES:
        module = importlib.import_module(f"endotsr.gradcheck.{name}")
        for pair in module.PAIRS:
            if pair.name in found:
                raise ValueError(f"pair {pair.name} is registered twice")
            found[pair.name] = pair
    return found


def pair_stream(name: str, seed: int) -> np.random.Generator:
    """The random stream of one pair: depends on its name and the seed only, not on which other pairs run.

    Raises: InputError for a seed below 0, which NumPy does not take.
    """
    if seed < 0:
        raise InputError(f"--seed {seed} is not allowed; allowed: an integer >= 0")
    return np.random.default_rng([seed, *name.encode()])


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Kernels run on one thread inside: pairs are small, and waking a second thread costs more than it brings."""
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
