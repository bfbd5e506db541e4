"""Every variant of every operation as a forward/reverse pair, for the gradient checks and the tables.

`tests/test_conventions.py` asserts that `all_pairs` includes every `<operation>_forward` of the package.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import InputError
from endotsr.port.operations.operation import Operation, Variant, real_of

Arrays = Mapping[str, NDArray]


class Pair(NamedTuple):
    """One forward pass and its reverse pass, with the signatures expected by the checker.

    name      variant of an operation, or any name for a custom pair
    equation  the equation label of the specification ("1" ... "7" for the paper, "B..." for the base model)
    inputs    rng -> float64 arrays, all differentiable, non-vacuous and away from kinks
    forward   inputs -> outputs, by name; float arrays (a scalar loss is an array of shape ())
    reverse   (inputs, cotangents by output name) -> gradients by input name
    blocks    inputs -> (input name, boolean mask or slice) by block name: separately probed parts;
              None = one block per input array
    trace     inputs -> integer arrays: the discrete decisions (order, contributors, clamps) of the forward
              pass; a finite difference with different decisions at its ends is rejected. None = no decisions
    function  dotted name of the forward function, for tables
    hard      inputs -> flat indices by input name: entries that are always probed individually
    single    "" = the pair also runs in float32; otherwise the reason for its omission
    traced    inputs -> (outputs, decisions) of one forward pass, for pairs with a trace; None = two passes
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
    traced: Callable[[Arrays], tuple[Mapping[str, NDArray], Mapping[str, NDArray]]] | None = None


def pair_of(operation: Operation, variant: Variant) -> Pair:
    """The operation with the settings and the fixed inputs of one of its variants.

    Raises: ValueError for an operation without a reverse pass.
    """
    reverse_pass, trace_pass = operation.reverse, operation.trace
    if reverse_pass is None:
        raise ValueError(f"operation {operation.name} has no reverse pass that variant {variant.name} could check")

    def whole(inputs: Arrays) -> Arrays:
        return inputs if variant.fixed is None else {**inputs, **variant.fixed(real_of(inputs))}

    def forward(inputs: Arrays) -> dict[str, NDArray]:
        outputs, _ = operation.forward(whole(inputs), variant.settings)
        return {name: np.asarray(value) for name, value in outputs.items()}

    def traced(inputs: Arrays) -> tuple[dict[str, NDArray], Mapping[str, NDArray]]:
        assert trace_pass is not None
        everything = whole(inputs)
        outputs, saved = operation.forward(everything, variant.settings)
        found = {name: np.asarray(value) for name, value in outputs.items()}
        return found, trace_pass(everything, variant.settings, saved)

    def reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
        _, saved = operation.forward(whole(inputs), variant.settings)
        found = reverse_pass(cotangents, saved)
        return {name: np.asarray(found[f"d_{name}"]) for name in inputs}

    return Pair(
        variant.name,
        operation.equation,
        variant.function or operation.function,
        variant.inputs,
        forward,
        reverse,
        variant.blocks,
        (lambda inputs: traced(inputs)[1]) if trace_pass is not None else None,
        variant.hard,
        variant.single,
        traced if trace_pass is not None else None,
    )


def all_pairs() -> dict[str, Pair]:
    """Every variant of every operation by name, in the order of the specification."""
    from endotsr.port.operations.registry import method_operations

    return {
        variant.name: pair_of(operation, variant)
        for operation in method_operations().values()
        for variant in operation.variants
    }


def definition_pairs() -> dict[str, Pair]:
    """The same pairs with the functions of `endotsr.definition`, without duplicates."""
    from endotsr.port.operations.definition import definition_operations

    return {
        variant.name: pair_of(operation, variant)
        for operation in definition_operations().values()
        for variant in operation.variants
    }


def pair_stream(name: str, seed: int) -> np.random.Generator:
    """The random stream of one pair; depends only on its name and the seed.

    Raises: InputError for a seed below 0, which NumPy rejects.
    """
    if seed < 0:
        raise InputError(f"--seed {seed} is not allowed; use an integer >= 0")
    return np.random.default_rng([seed, *name.encode()])


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Run kernels on one thread within the block: for small pairs, a second thread costs more than it gains."""
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
