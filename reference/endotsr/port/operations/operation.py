"""An operation: a forward pass, its reverse pass, their results, and the inputs of its checks.

Arrays and settings have the same names as in the golden cases. `d_NAME` is the derivative of the loss with respect to
NAME: a cotangent if NAME is an output, a gradient if it is an input.
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


def _always(settings: Settings) -> bool:
    return True


class Variant(NamedTuple):
    """One gradient check of an operation: settings, and inputs that are non-vacuous and away from kinks.

    name      of the check, unique in the registry
    inputs    rng -> float64 arrays, all differentiable
    settings  held fixed; as in a golden case
    fixed     precision -> further inputs, which are not differentiated
    blocks    inputs -> (input name, mask or index) by block name: separately probed parts;
              None = one block per input array
    covers    settings of a golden case -> whether this variant covers that case
    function  dotted name of the forward function if it differs from the operation's
    hard      inputs -> flat indices by input name: entries that are always probed individually
    single    "" = the variant is also compared in float32; otherwise the reason for its omission
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


class Operation(NamedTuple):
    """One computation of the method.

    name      name of the operation in golden cases
    equation  label of the specification ("1" ... "7" for the paper, "B..." for the base model); "" = none
    text      short description
    function  dotted name of the forward function of the package
    forward   (inputs, settings) -> (differentiable outputs, saved); a `partial` on the module of its functions, which
              the module of the definition can replace
    reverse   (cotangents by output name, saved) -> gradients, named `d_` and the input; None = not differentiated
    extra     (inputs, settings, saved) -> further outputs, which are not differentiated
    trace     (inputs, settings, saved) -> the discrete decisions of the forward pass (order, contributors, clamps,
              signs); a finite difference across a change of them is rejected. None = no decisions
    variants  the gradient checks
    is_loss   the only output is the differentiated loss; its cotangent defaults to 1
    plain     the pair wrapped by the operation, whose twin has the same names; None = written out
    """

    name: str
    equation: str
    text: str
    function: str
    forward: Callable[[Inputs, Settings], tuple[Found, Any]]
    reverse: Callable[[Inputs, Any], Found] | None = None
    extra: Callable[[Inputs, Settings, Any], Found] | None = None
    trace: Callable[[Inputs, Settings, Any], Mapping[str, NDArray]] | None = None
    variants: tuple[Variant, ...] = ()
    is_loss: bool = False
    plain: "PlainPair | None" = None

    def compute(self, inputs: Inputs, settings: Settings) -> Outputs:
        """All results of a request: outputs, and gradients if the request has every cotangent.

        returns  arrays by name in C order
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
        """Names of the variants that cover a golden case with these settings."""
        return tuple(variant.name for variant in self.variants if variant.covers(settings))


class PlainPair(NamedTuple):
    """A forward and a reverse function with inputs and settings by name, and one output.

    arguments   names of inputs and settings, in the order of the parameters
    output      name of the value
    gradient    name of the gradient if the reverse pass returns one array; "": it returns a NamedTuple
    """

    forward: Any
    reverse: Any
    arguments: str
    output: str
    gradient: str = ""

    def run(self, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
        """The forward pass of a request; an input without axes is passed as a number."""
        given = {**settings, **{name: _number(value) for name, value in inputs.items()}}
        value, saved = self.forward(*(given.get(name) for name in self.arguments.split()))
        return {self.output: value}, saved

    def back(self, cotangents: Inputs, saved: Any) -> Found:
        """The gradients of a request."""
        found = self.reverse(_number(cotangents[self.output]), saved)
        return {self.gradient: found} if self.gradient else found._asdict()

    def operation(self, name: str, equation: str, text: str, **fields: Any) -> Operation:
        """The operation of this pair; `fields` as of `Operation`."""
        function = f"{self.forward.__module__}.{self.forward.__name__}"
        return Operation(name, equation, text, function, self.run, self.back, plain=self, **fields)


def _number(value: NDArray) -> Any:
    return float(value) if np.ndim(value) == 0 and np.asarray(value).dtype.kind == "f" else value


def real_of(inputs: Inputs) -> np.dtype:
    """The precision of a request: the dtype of its first real input, float64 without one."""
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
