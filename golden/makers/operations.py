"""What is declared of an operation of the golden cases: its outputs, its settings, and its row in golden/README.md.

A family module has DECLARED, its operations by name; `makers.registry` gathers them. A family of further cases of
operations that another one declares has no DECLARED.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

PER_DISPLAY, PER_LENGTH = "loss per display unit", "loss per scene unit"


class Judged(NamedTuple):
    """An array that a port returns."""

    level: int
    unit: str = "1"
    scale: str = "max"  # "exact", "max", "last" or "identical OUTPUT"
    oracle: str = ""  # name in the golden files of the independent program that gives the value; empty: there is none
    least32: float = 0.0  # least float32 tolerance: what another sound formula loses, beyond the measured spread
    order: str = ""  # "iteration": entry k is of iteration k + 1


class Declared(NamedTuple):
    """An operation.

    outputs    every output, further output and gradient in order, with its level, its unit, the scale of its
               comparison, and the independent program that computes its value
    note       of its row in the table of golden/README.md
    equations  in that row, where they are more than the one of the operation
    settings   setting of a case -> key of the configuration with the same value, where the name is not this key
    free       keys of the configuration that no case must vary, with the reason; see `makers.hard_coded`
    """

    outputs: Mapping[str, Judged]
    note: str
    equations: str = ""
    settings: Mapping[str, str] = MappingProxyType({})
    free: Mapping[str, str] = MappingProxyType({})
