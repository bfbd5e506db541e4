"""What an operation of the golden cases is: a name, its outputs, and the reference that computes them."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

Inputs = Mapping[str, NDArray]
Settings = Mapping[str, Any]
Outputs = dict[str, NDArray]
Compute = Callable[[Inputs, Settings], Mapping[str, NDArray | float | None]]


def written(settings: msgspec.Struct) -> dict[str, Any]:
    """Settings as a case writes them: without the exposure (B13), which is off in all cases but those of its own."""
    plain = msgspec.to_builtins(settings)
    for section in (plain, plain.get("model"), plain.get("optimiser")):
        if section is not None:
            section.pop("exposure", None)
    return plain


class Asked(NamedTuple):
    """An output of an operation."""

    level: int
    unit: str = "1"
    scale: str = "max"  # "exact", "max" or "last"
    oracle: str = ""  # "<file of tests/oracle>.<function>"; empty: the reference itself is the truth
    least32: float = 0.0  # least float32 tolerance: what another sound formula loses, beyond the measured spread


class Operation(NamedTuple):
    """Reference computation of one kind of case; it may give fewer outputs than `asked` names."""

    name: str
    equation: str
    text: str
    compute: Compute
    asked: Mapping[str, Asked]
    pairs: Callable[[Settings], tuple[str, ...]] = lambda settings: ()  # registered pairs that a case exercises


def real_of(inputs: Inputs) -> np.dtype:
    """The precision of a request: that of its first real input."""
    for array in inputs.values():
        if array.dtype.kind == "f":
            return array.dtype
    return np.dtype(np.float64)


def tidy(found: Mapping[str, NDArray | float | None]) -> Outputs:
    """Outputs as C-ordered arrays; what is None was not asked for."""
    return {name: np.array(value, order="C") for name, value in found.items() if value is not None}


def in_precision(inputs: Inputs, precision: str) -> dict[str, NDArray]:
    """Real inputs in the given precision (exact: they are float32 numbers), others as they are."""
    return {name: np.array(a, precision) if a.dtype.kind == "f" else np.array(a) for name, a in inputs.items()}
