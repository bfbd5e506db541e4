"""The Pareto front: a setting is dominated if another has no larger cost and error, and one of them is smaller."""

from collections.abc import Iterable
from typing import NamedTuple


class Ranked(NamedTuple):
    """A point of a work-precision diagram."""

    name: str
    cost: float
    errors: tuple[float, ...]


def non_dominated(points: Iterable[Ranked]) -> list[Ranked]:
    """The front in cost and first error, cheapest first; of equal points the first."""
    front: list[Ranked] = []
    for point in sorted(points, key=lambda p: (p.cost, p.errors[0])):
        if not front or point.errors[0] < front[-1].errors[0]:
            front.append(point)
    return front
