"""The comparison of every compiled function with its definition in plain NumPy (`endotsr.definition`), in float64.

In: an operation, its twin and requests (arrays and settings by name, cotangents included). Out: for every output and
gradient the largest difference in units of its scale, which for most arrays is their largest magnitude. The test and
the table of the book use the bounds of this module.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.gradcheck.registry import one_thread, pair_stream
from endotsr.port.judge.compare import largest
from endotsr.port.judge.store import Golden
from endotsr.port.operations.definition import definition_operations
from endotsr.port.operations.operation import Inputs, Operation, Settings
from endotsr.port.operations.registry import method_operations
from makers.operations import Judged
from makers.registry import JUDGED

SEEDS = (0, 1, 2)
BOUND = 2e-14  # of the scale, for every output that is not in BOUNDS
BOUNDS = {
    "objective": (1e-13, "a gradient is a sum over Gaussians and pixels in which large terms cancel"),
    "render": (1e-12, "a gradient is a sum over pixels in which large terms cancel; short needles"),
    "training": (1e-13, "roundings of one iteration are inputs of the next"),
    "render of a long needle": (1e-5, "the definition inverts Sigma, and loses (length / width)^2 roundings"),
    "composite behind opaque": (
        1e-12,
        "the gradient behind an opaque Gaussian is below a rounding of the largest one; both functions miss its value "
        "in extended precision by as much as they differ",
    ),
}
APART = {  # cases with a row of their own
    "golden render/long_needle": "render of a long needle",
    "golden composite/opaque_exact": "composite behind opaque",
}
ANY_VALUE = 1.0  # a float64 tolerance of at least one scale allows any value: the output is rounding noise


class TwinRequest(NamedTuple):
    """Arrays and settings of a generated input or a golden case, and the requested outputs; empty = all."""

    label: str
    inputs: Inputs
    settings: Settings
    asked: tuple[str, ...] = ()


class Distance(NamedTuple):
    """The largest difference of one output over all requests of an operation."""

    operation: str
    function: str  # of the definition
    output: str
    distance: float  # in units of the scale
    bound: float
    request: str  # where it is largest


def made_up(operation: Operation, seeds: Iterable[int] = SEEDS) -> Iterator[TwinRequest]:
    """The inputs of the gradient checks of an operation, with a random cotangent for every output."""
    for variant in operation.variants:
        for seed in seeds:
            rng = pair_stream(variant.name, seed)
            inputs = variant.inputs(rng)
            inputs |= {} if variant.fixed is None else variant.fixed(np.dtype(np.float64))
            outputs, _ = operation.forward(inputs, variant.settings)
            cotangents = {f"d_{name}": rng.normal(0, 1, np.asarray(value).shape) for name, value in outputs.items()}
            yield TwinRequest(f"{variant.name}, seed {seed}", inputs | cotangents, variant.settings)


def scaled(got: NDArray, wanted: NDArray, scale: str) -> float:
    """The largest difference in units of the scale, by the judge's rule; infinite if "exact" arrays differ."""
    got, wanted = np.asarray(got), np.asarray(wanted)
    if np.array_equal(got, wanted):
        return 0.0
    return np.inf if scale == "exact" else largest(got, wanted, scale)


def golden_requests(golden: Golden) -> Iterator[tuple[str, TwinRequest]]:
    """(name of the operation, request) of every case."""
    for case in golden.cases:
        inputs = {name: golden.array(case, array.file) for name, array in case.inputs.items()}
        asked = tuple(name for name, output in case.outputs.items() if output.compare.float64 < ANY_VALUE)
        yield case.operation, TwinRequest(f"golden {case.name}", inputs, case.settings, asked)


def distances(
    operation: Operation, twin: Operation, requests: Iterable[TwinRequest], judged: Mapping[str, Judged]
) -> list[Distance]:
    """The worst difference of every output of the operation over all requests, with separate rows for `APART`.

    judged   the outputs of the operation, as in `makers.registry`
    """
    worst: dict[tuple[str, str], tuple[float, str]] = {}
    for request in requests:
        name = APART.get(request.label, operation.name)
        with one_thread(), np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            wanted = operation.compute(request.inputs, request.settings)
            got = twin.compute(request.inputs, request.settings)
        for output in request.asked or [output for output in judged if output in wanted]:
            missing = np.array(np.nan)
            found = scaled(got.get(output, missing), wanted.get(output, missing), judged[output].scale)
            if found >= worst.get((name, output), (-1.0, ""))[0]:
                worst[name, output] = (found, request.label)
    return [
        Distance(name, twin.function, output, size, BOUNDS.get(name, (BOUND, ""))[0], label)
        for (name, output), (size, label) in worst.items()
    ]


def all_distances(stored: Iterable[tuple[str, TwinRequest]] = ()) -> list[Distance]:
    """Every operation on its generated inputs and on further requests, given as (operation name, request)."""
    more: dict[str, list[TwinRequest]] = {}
    for name, request in stored:
        more.setdefault(name, []).append(request)
    operations, found = method_operations(), []
    for name, twin in definition_operations().items():
        found += distances(operations[name], twin, [*made_up(operations[name]), *more.get(name, ())], JUDGED[name])
    return found
