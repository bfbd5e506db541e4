"""Decisions that a port takes otherwise: by the convention of another program, or at another threshold.

In: the search for one operation. Out: its hits. A convention is one prepared change; a threshold is a number that is
searched for by how many entries of the outputs still differ, since outputs do not change continuously with it.
"""

import ast
import contextlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from endotsr.port.search.conventions import prepared
from endotsr.port.search.images import OF_IMAGES
from endotsr.port.search.places import Spot, Statement, spots, written
from endotsr.port.search.requests import OtherReading, other_requests
from endotsr.port.search.screen import OF_THE_SCREEN
from endotsr.port.search.trial import Trial
from endotsr.port.stages.stage import Outputs

SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
FIRST = (0.0, 0.5, 2.0, 1e6)  # factors of a threshold; a number with which these four change nothing is passed over
FACTORS = (1e-6, 1e-3, 1e-2, 0.1, 0.25, 0.7, 0.85, 0.95, 0.99, 1.01, 1.05, 1.15, 1.4, 4, 10, 100, 1e3)
ROUNDS = 5  # refinements of the best factor
FEWER = 0.8  # largest fraction of the wrong entries that is left at a factor that is refined
HALVINGS = 12  # of either end of the interval of a threshold
KNOWN = (1 / 256, 1 / 255, 1 / 128, 1 / 512, 1e-3, 1e-4, 1e-6, 0.2, 0.01)
"""Thresholds of other programs."""


def try_conventions(trial: Trial, places: Sequence[Statement]) -> None:
    """The prepared changes of executed functions."""
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
            trial.note(whole, change.said + alone, change.spot, 1, 0)


class Interval(NamedTuple):
    """Numbers that give the same decisions, from the lowest to the highest that were tried."""

    low: float
    high: float

    def numbers(self) -> list[float]:
        """Numbers of the interval, those of few digits and those of other programs first."""
        middle = (self.low + self.high) / 2
        plain = [float(f"{middle:.{digits}g}") for digits in (1, 2)]
        inside = [k for k in dict.fromkeys((*KNOWN, *plain)) if self.low <= k <= self.high]
        return [*inside, middle, *np.linspace(self.low, self.high, 7)[1:-1]]


def threshold(wrong: Callable[[float], int], rest: float) -> Interval | None:
    """Numbers at which nothing is wrong, near a number `rest` at which something is; None if none is found.

    wrong   number -> entries of the outputs that differ
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
    good = [k for k, count in tried.items() if not count]
    if not good or not before:
        return None
    low, high = min(good), max(good)
    below = max((k for k in ordered if k < low), default=low)
    above = min((k for k in ordered if k > high), default=high)
    return Interval(_end(wrong, low, below), _end(wrong, high, above))


def _end(wrong: Callable[[float], int], good: float, bad: float) -> float:
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if not wrong(middle) else (good, middle)
    return good


def try_thresholds(trial: Trial, places: Sequence[Statement]) -> None:
    """Decisions at another number, if nothing else explains both passes; in a trajectory, each costs too much.

    Tried are numeric settings fixed at another number, and every comparison of the definition with a number.
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
    sign = SIGNS.get(type(node.ops[0]))
    if sign is None or len(node.ops) > 1:
        return
    left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
    mode, seen = trial.modes(spot.place)[0], list[float]()

    def looked(value: float) -> float:
        seen.append(value)
        return value

    names["_seen"] = looked
    with written(spot, f"({left}) {sign} _seen({right})"):
        trial.outputs(spot.place.compiled(), mode)
    if not seen or any(np.ndim(value) or value != seen[0] for value in seen):
        return
    with written(spot, f"({left}) {sign} _knob"):
        install = spot.place.compiled()

    def wrong(number: float) -> int:
        names["_knob"] = number
        return differing(trial, trial.outputs(install, mode))

    found = threshold(wrong, float(seen[0]))
    for number in found.numbers() if found else ():
        names["_knob"] = number
        whole, phases = trial.best(install, mode)
        if whole and found:
            alone = f", in the {phases} pass alone" if phases != "both" and len(spot.place.phases) > 1 else ""
            trial.note(whole, f"`{left} {sign} {said(number, found, float(seen[0]))}`{alone}", spot, 1, 3)
            return


def said(number: float, found: Interval, right: float) -> str:
    """A threshold with its interval, and the right one."""
    return f"{number:.6g}` (any number from {found.low:.4g} to {found.high:.4g} explains it) where `{right:.6g}"


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
            text = f"{at(number).text} (any number from {found.low:.4g} to {found.high:.4g} explains it)"
            trial.note(whole, text, None, 1, 2)
            return
