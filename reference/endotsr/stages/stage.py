"""A stage: a forward pass, its reverse pass, the arrays that it returns and the inputs at which it is checked.

The names of arrays and settings are those of the golden cases. `d_NAME` is the derivative of the loss by NAME: a
cotangent where NAME is an output, a gradient where it is an input.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Inputs = Mapping[str, NDArray]
Settings = Mapping[str, Any]
Outputs = dict[str, NDArray]
Found = Mapping[str, NDArray | float | None]
Blocks = Mapping[str, tuple[str, object]]


class Asked(NamedTuple):
    """An array that a stage returns, and how a golden case judges it."""

    level: int
    unit: str = "1"
    scale: str = "max"  # "exact", "max" or "last"
    oracle: str = ""  # name in the golden files of the independent program that gives the value; empty: there is none
    least32: float = 0.0  # least float32 tolerance: what another sound formula loses, beyond the measured spread
    order: str = ""  # "iteration": entry k is of iteration k + 1


def _always(settings: Settings) -> bool:
    return True


class Variant(NamedTuple):
    """One gradient check of a stage: settings, and inputs that are non-vacuous and away from kinks.

    name      of the check, unique in the registry
    inputs    rng -> float64 arrays; every one of them is differentiable
    settings  held fixed; as in a golden case
    fixed     precision -> further inputs, which are not differentiated
    blocks    inputs -> (input name, mask or index) by block name: what is probed separately;
              None = one block per input array
    covers    settings of a golden case -> whether that case exercises what this variant checks
    function  dotted name of the forward function where it is not that of the stage
    hard      inputs -> flat indices by input name: entries that are always probed one by one
    single    "" = the variant is also compared in float32; otherwise the reason why it cannot be
    """

    name: str
    inputs: Callable[[np.random.Generator], dict[str, NDArray]]
    settings: Settings = MappingProxyType({})
    fixed: Callable[[np.dtype], Mapping[str, NDArray]] | None = None
    blocks: Callable[[Inputs], Blocks] | None = None
    covers: Callable[[Settings], bool] = _always
    function: str = ""
    hard: Callable[[Inputs], Mapping[str, NDArray]] | None = None
    single: str = ""


class Stage(NamedTuple):
    """One computation of the method.

    name      as the golden cases name their operation
    equation  label of the specification ("1" ... "7" for the paper, "B..." for the base model); "" = none
    text      what it computes, in a few words
    function  dotted name of the forward function of the package
    inputs    unit by name of every array that a request may hold, cotangents apart
    forward   (inputs, settings) -> (outputs that can be differentiated, saved)
    asked     outputs, `extra` outputs and gradients in the order in which they are stored and judged
    reverse   (cotangents by output name, saved) -> gradients, named `d_` and the input; None = not differentiated
    extra     (inputs, settings, saved) -> further outputs, which are not differentiated
    trace     (inputs, settings, saved) -> the discrete decisions of the forward pass (order, contributors, clamps,
              signs); a finite difference across a change of them is refused. None = no decisions
    variants  the gradient checks
    is_loss   the one output is the loss that all derivatives are of: its cotangent is 1 unless it is given
    """

    name: str
    equation: str
    text: str
    function: str
    inputs: Mapping[str, str]
    forward: Callable[[Inputs, Settings], tuple[Found, Any]]
    asked: Mapping[str, Asked]
    reverse: Callable[[Inputs, Any], Found] | None = None
    extra: Callable[[Inputs, Settings, Any], Found] | None = None
    trace: Callable[[Inputs, Settings, Any], Mapping[str, NDArray]] | None = None
    variants: tuple[Variant, ...] = ()
    is_loss: bool = False

    def compute(self, inputs: Inputs, settings: Settings) -> Outputs:
        """All results of a request: outputs, and gradients where the request holds every cotangent.

        returns  arrays by name in C order; may hold more, or fewer, names than `asked`
        """
        outputs, saved = self.forward(inputs, settings)
        found = dict(outputs)
        if self.extra is not None:
            found |= self.extra(inputs, settings, saved)
        given = {name: inputs[f"d_{name}"] for name in outputs if f"d_{name}" in inputs}
        cotangents = dict.fromkeys(outputs, np.array(1.0)) | given if self.is_loss else given
        if self.reverse is not None and cotangents.keys() == outputs.keys():
            found |= self.reverse(cotangents, saved)
        return tidy(found)

    def checks(self, settings: Settings) -> tuple[str, ...]:
        """Names of the variants that a golden case with these settings exercises."""
        return tuple(variant.name for variant in self.variants if variant.covers(settings))


def real_of(inputs: Inputs) -> np.dtype:
    """The precision of a request: that of its first real input, float64 without one."""
    for array in inputs.values():
        if array.dtype.kind == "f":
            return array.dtype
    return np.dtype(np.float64)


def tidy(found: Found) -> Outputs:
    """Outputs as C-ordered arrays; None marks an output that was not requested."""
    return {name: np.array(value, order="C") for name, value in found.items() if value is not None}


def split_blocks(parts: Mapping[str, Mapping[str, object]]) -> Callable[[Inputs], Blocks]:
    """Blocks (index by block name) of some inputs by name; each other input is one block."""

    def blocks(inputs: Inputs) -> Blocks:
        found = {block: (name, index) for name, indices in parts.items() for block, index in indices.items()}
        return found | {name: (name, ...) for name in inputs if name not in parts}

    return blocks
