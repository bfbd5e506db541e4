"""Decisions that a port takes otherwise: by the convention of another program, or at another threshold.

In: the search for one operation. Out: its hits. A convention is a prepared change. A threshold is searched for by the
number of entries of the outputs that still differ: decisions do not change continuously with it.
"""

import ast
import contextlib
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from endotsr.port.operations.operation import Outputs
from endotsr.port.search.conventions import prepared
from endotsr.port.search.images import OF_IMAGES
from endotsr.port.search.places import Spot, Statement, spots, written
from endotsr.port.search.requests import OtherReading, other_requests
from endotsr.port.search.screen import OF_THE_SCREEN
from endotsr.port.search.trial import Trial, installed

SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
FIRST = (0.0, 0.5, 2.0, 1e6)  # factors tried first; if none changes the number of wrong entries, no other is tried
FACTORS = (1e-6, 1e-3, 1e-2, 0.1, 0.25, 0.7, 0.85, 0.95, 0.99, 1.01, 1.05, 1.15, 1.4, 4, 10, 100, 1e3)
ROUNDS = 5  # refinements of the best factor
FEWER = 0.8  # largest fraction of the wrong entries that is left at a factor that is refined
HALVINGS = 12  # of either end of the interval of a threshold
WIDE = 100.0  # ratio of the ends of an interval
KNOWN = (1 / 256, 1 / 255, 1 / 128, 1 / 512, 1e-3, 1e-4, 1e-6, 0.2, 0.01)
"""Thresholds of other programs."""


def try_conventions(trial: Trial, places: Sequence[Statement]) -> None:
    """The prepared changes whose first function was executed, or whose constant is in a module with such a function.

    If a forward output is refused, those of a reverse pass alone are passed over; if none is, all others are.
    """
    names = {place.name for place in places}
    constants = {place.module.__name__.rpartition(".")[2] for place in places}
    for convention in (*OF_THE_SCREEN, *OF_IMAGES):
        own, _, _ = convention.changes[0]
        if trial.over or not (own in names or (own.rpartition(".")[2].isupper() and own.split(".")[0] in constants)):
            continue
        change = prepared(convention)
        reverse = all(name.endswith("_reverse") for name in change.names)
        if reverse == trial.forward_refused:
            continue
        with contextlib.suppress(Exception):  # a changed text may raise anything
            whole, mode = trial.best(change.install, "reverse" if reverse else "both")
            alone = ", in the forward pass alone" if mode == "forward" and not reverse else ""
            stands = None if alone else partial(installed, change.install)
            trial.note(whole, change.said + alone, change.spot, 1, 0, standing=stands)


class Interval(NamedTuple):
    """Numbers that give the same decisions, as far as they were tried: the lowest and the highest."""

    low: float
    high: float

    @property
    def wide(self) -> bool:
        """Whether the outputs hardly determine the number: an expression that explains them is likelier."""
        return self.high > WIDE * abs(self.low)

    def numbers(self) -> list[float]:
        """Numbers of the interval: those of other programs, those of one and two digits, the middle, five others."""
        middle = (self.low + self.high) / 2
        plain = [float(f"{middle:.{digits}g}") for digits in (1, 2)]
        inside = [k for k in dict.fromkeys((*KNOWN, *plain)) if self.low <= k <= self.high]
        return [*inside, middle, *np.linspace(self.low, self.high, 7)[1:-1]]


def threshold(wrong: Callable[[float], int], rest: float) -> Interval | None:
    """Numbers at which nothing is wrong, near a number `rest` at which something is; None if none is found.

    wrong   number -> entries of the outputs that differ

    Of several intervals with a wrong number between them, the one nearest to `rest` is taken.
    """
    unit, before = rest or 1.0, wrong(rest)
    tried = {k * unit: wrong(k * unit) for k in FIRST}
    if all(count == before for count in tried.values()):
        return None
    tried |= {k * unit: wrong(k * unit) for k in FACTORS}
    for _ in range(ROUNDS):
        ordered = sorted(tried)
        best = min(ordered, key=lambda k: tried[k])
        if not tried[best] or tried[best] > FEWER * before:
            break
        at = ordered.index(best)
        ends = ordered[max(at - 1, 0)], ordered[min(at + 1, len(ordered) - 1)]
        tried |= {k: wrong(k) for k in np.linspace(*ends, 8)[1:-1] if k not in tried}
    ordered = sorted(tried)
    good = [at for at, k in enumerate(ordered) if not tried[k]]
    if not good or not before:
        return None
    low = high = min(good, key=lambda at: abs(ordered[at] - rest))
    while low - 1 in good:
        low -= 1
    while high + 1 in good:
        high += 1
    below, above = ordered[max(low - 1, 0)], ordered[min(high + 1, len(ordered) - 1)]
    return Interval(_end(wrong, ordered[low], below), _end(wrong, ordered[high], above))


def _end(wrong: Callable[[float], int], good: float, bad: float) -> float:
    """The last good number found between a good number and the next one tried."""
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if not wrong(middle) else (good, middle)
    return good


def try_thresholds(trial: Trial, places: Sequence[Statement]) -> None:
    """Decisions at another number, if nothing else explains both passes; in a trajectory, each costs too much.

    Tried are real settings fixed at another number, and single comparisons by <, <=, > and >= of these functions whose
    right side is the same number at each evaluation.
    """
    if trial.explains or trial.length:
        return
    for request in other_requests([one.case for one in trial.cases], trial.golden.cases):
        if request.at is not None and not trial.over:
            with contextlib.suppress(Exception):
                _fixed(trial, request.at, request.rest)
    for place in places:
        for spot in spots(place):
            if not trial.over and isinstance(spot.node, ast.Compare) and len(spot.holders) == 1:
                with contextlib.suppress(Exception):
                    _compared(trial, spot)


def _compared(trial: Trial, spot: Spot) -> None:
    node, names = spot.node, spot.place.module.__dict__
    assert isinstance(node, ast.Compare)
    if len(node.ops) > 1 or not isinstance(node.ops[0], (ast.Eq, *SIGNS)):
        return
    left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
    mode = trial.modes(spot.place)[0]
    equal = isinstance(node.ops[0], ast.Eq)
    near, rest = f"np.abs(({left}) - ({right})) <=", 0.0
    if not equal:
        near = f"({left}) {SIGNS[type(node.ops[0])]}"
        rest = _constant(trial, spot, f"{near} _seen({right})", mode)
    if rest is None:
        return
    with written(spot, f"{near} _knob"):
        install = spot.place.compiled()

    def wrong(number: float) -> int:
        names["_knob"] = number
        return differing(trial, trial.outputs(install, mode))

    found = threshold(wrong, rest)
    for number in found.numbers() if found else ():
        names["_knob"] = number
        whole, phases = trial.best(install, mode)
        if whole and found:
            alone = f", in the {phases} pass alone" if phases != "both" and len(spot.place.phases) > 1 else ""
            case = trial.cases[0].case.name
            text = f"{left} {SIGNS[type(node.ops[0])]} {said(number, found, rest, case)}" if not equal else (
                f"|{left} - {right}| <= {number:.6g}`{extent(found, case)} where `{left} == {right}"
            )  # fmt: skip
            trial.note(whole, f"`{text}`{alone}", spot, 1 + found.wide, 3)
            return


def _constant(trial: Trial, spot: Spot, text: str, mode: str) -> float | None:
    """The right side of a comparison, if it is the same number at each evaluation."""
    seen = list[float]()

    def looked(value: float) -> float:
        seen.append(value)
        return value

    spot.place.module.__dict__["_seen"] = looked
    with written(spot, text):
        trial.outputs(spot.place.compiled(), mode)
    same = bool(seen) and not any(np.ndim(value) or value != seen[0] for value in seen)
    return float(seen[0]) if same else None


def said(number: float, found: Interval, right: float, case: str) -> str:
    """A threshold with its interval in a case, and the right one."""
    return f"{number:.6g}`{extent(found, case)} where `{right:.6g}"


def extent(found: Interval, case: str) -> str:
    """An interval in words; it is that of one case, and another case may narrow it."""
    return f" (any number from {found.low:.4g} to {found.high:.4g} gives the decisions of {case})"


def differing(trial: Trial, found: Outputs) -> int:
    """Number of entries of the first case that differ from the port's."""
    one = trial.cases[0]
    return sum(one.off(name, np.asarray(found[name])) for name in one.got)


def _fixed(trial: Trial, at: Callable[[float], OtherReading], rest: float) -> None:
    """A setting fixed at a number that gives the port's decisions."""
    found = threshold(lambda k: differing(trial, trial.outputs(None, "both", at(k))), rest)
    for number in found.numbers() if found else ():
        whole = trial.fits(None, "both", at(number))
        if whole and found:
            text = f"{at(number).text}{extent(found, trial.cases[0].case.name)}"
            trial.note(whole, text, None, 1 + found.wide, 2)
            return
