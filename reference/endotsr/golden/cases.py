"""What a golden case is before its answers are computed, and the list of all of them."""

import importlib
from typing import Any, NamedTuple

from endotsr.golden.generator import Made, uniform

CASE_MODULES = ("cases_equations", "cases_losses", "cases_splatting", "cases_fitting", "cases_scene", "cases_edges")


class Spec(NamedTuple):
    """A case without its answers."""

    family: str
    case: str
    operation: str
    title: str
    flags: tuple[str, ...]
    settings: dict[str, Any]
    inputs: dict[str, Made]
    still: tuple[str, ...] = ()  # inputs that stand at a tie or kink: not perturbed when spreads are measured
    without: tuple[str, ...] = ()  # outputs that this case does not ask for
    band: int = 0  # flip budget of the images, for a case that stands on the cutoff
    own: tuple[str, ...] = ()  # outputs for which the oracle has no answer here: the truth is the reference
    either: tuple[dict[str, Any], ...] = ()  # settings with which the reference gives the other legal answers

    @property
    def name(self) -> str:
        """family/case"""
        return f"{self.family}/{self.case}"


class Seeds:
    """Uniform arrays of one case, each under its own seed "family/case/array"."""

    def __init__(self, family: str, case: str, draw: int = 0) -> None:
        self.name, self.draw = f"{family}/{case}", f"#{draw}" if draw else ""

    def seed(self, array: str) -> str:
        """The seed text of an array."""
        return f"{self.name}/{array}{self.draw}"

    def uniform(self, array: str, low: float, high: float, *shape: int, unit: str = "1") -> Made:
        """See `generator.uniform`."""
        return uniform(self.seed(array), low, high, shape, unit)


def all_specs() -> list[Spec]:
    """Every case, in the order of the families."""
    found: list[Spec] = []
    for module in CASE_MODULES:
        found += importlib.import_module(f"endotsr.golden.{module}").cases()
    names = [spec.name for spec in found]
    if len(set(names)) != len(names):
        raise ValueError("a golden case is named twice")
    return found
