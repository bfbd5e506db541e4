"""The changes of the definition that are tried for one operation, likely ones first.

First come the conventions of other programs, and settings and inputs read differently, for a part of the time. For an
operation with parts, numbers, other texts and other names of one expression in its own code follow. Then come the other
settings and inputs, those read for one another, entries of tuples exchanged, decisions at another number, and one
expression in the remaining functions and in the constants. Changes of more than one expression follow: two of one form,
a mean of means, the order of statements, a part of an array, two numbers of a line, and an expression beside another.
At the end come texts of the expressions of which a small change leaves a wrong output as it is. A trajectory has no
conventions, no exchanges and no thresholds.
"""

import ast
import contextlib
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from endotsr.port.judge.store import Golden
from endotsr.port.operations.operation import Operation, Outputs
from endotsr.port.search.cases import Answered, of_the_parts
from endotsr.port.search.conventions import together
from endotsr.port.search.decisions import try_conventions, try_thresholds
from endotsr.port.search.numbers import START, said_number
from endotsr.port.search.places import Spot, Statement, definition_modules, executed, names_in, spots, written
from endotsr.port.search.requests import OtherReading, exchanges, other_requests
from endotsr.port.search.rewrites import rewrites, rounded, with_number
from endotsr.port.search.second import (
    SecondChange,
    alike,
    at,
    beside,
    expressions,
    in_both,
    in_operations,
    mean_of_means,
    orders,
    pairs,
    parts,
    turned,
)
from endotsr.port.search.trial import LATEST, TELLING, UNREACHED, Live, Trial, installed

SECONDS = 16.0  # computing time of a search; `find` gives a trajectory more
UNKNOWN = 1  # assumed number of outputs spoiled by a change of an expression, if unknown
EARLY = 0.3  # of the time, for settings and inputs before the code of an operation with parts
PART = 0.1  # of the time that is left, for the exchanges in tuples
MOST_BESIDE = 6  # readings of a setting or an input that leave a wrong output as it is
MOST_VALUES = 64  # examined values of an expression


def search(operation: Operation, answered: Sequence[Answered], golden: Golden, seconds: float = SECONDS) -> Trial:
    """Changes of one operation that explain the port's outputs, best first in `hits`."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found = Trial(operation, answered, golden, seconds)
        calls: dict[str, Callable[[], Any]] = {
            "forward": lambda: [one.forward(operation, one.inputs, one.settings) for one in answered],
            "reverse": lambda: [one.reverse(operation, one.inputs, one.saved) for one in answered],
        }
        places = executed(calls)
        for module in definition_modules():
            module.__dict__.update(_at=at, _nth=found.counter.nth, _mean_of_means=mean_of_means)
        inner = of_the_parts(operation.name, golden)
        glue = [place for place in places if inner and not place.is_constant and place.name not in inner]
        if not found.length:
            try_conventions(found, places)
        if not found.explains:  # a prepared description is the one to read, and single expressions need not be tried
            _all_places(found, places, glue)
    for module in definition_modules():
        for name in ("_knob", "_seen", "_at", "_nth", "_mean_of_means"):
            module.__dict__.pop(name, None)
    found.hits.sort(key=lambda hit: hit.rank)
    return found


def _all_places(trial: Trial, places: Sequence[Statement], glue: Sequence[Statement]) -> None:
    """Changes of single expressions, those of the operation itself, `glue`, before its parts; then of more.

    The last ones are tried in the operation itself alone, if it has code beside its parts.
    """
    functions = [place for place in places if not place.is_constant]
    readings = other_requests([one.case for one in trial.cases], trial.golden.cases)
    with trial.within(0 if trial.length else EARLY):
        _requests(trial, readings)
    _places(trial, glue)
    _requests(trial, readings)
    _exchanges(trial, places)
    try_thresholds(trial, functions)
    _places(trial, [place for place in functions if place not in glue])
    _places(trial, [place for place in places if place.is_constant])
    _second(trial, list(glue) or functions)
    _other_texts(trial, [one for one in trial.live if one.late == UNREACHED])


def _places(trial: Trial, places: Sequence[Statement]) -> None:
    """Changes of some places: numbers, then other texts, then other names; for a trajectory, numbers last.

    After a likely change that explains both passes, other texts and names are tried in its line alone.
    """
    long = any(one.length for one in trial.cases)
    live = _reached(trial, places, long)
    trial.live += live
    _other_texts(trial, [one for one in live if one.late < UNREACHED])
    _forms(trial, [] if long else places, live)
    for one in live if long and not trial.explains else ():
        if not trial.over:
            _solved(trial, one.spot, one.mode, one.values)


def _other_texts(trial: Trial, live: Sequence[Live]) -> None:
    """Other texts of some spots, then other names."""
    for texts, rank in ((_texts, 1), (_names, 2)):
        lines = {hit.where for hit in trial.hits if hit.rank[:2] < (0, 2) and not trial.discrete}
        for one in live:
            if not lines or one.spot.place.where(one.spot.node) in lines:
                _try(trial, one, texts(one, trial.lower), rank)


def _requests(trial: Trial, readings: Iterator[OtherReading]) -> None:
    """Settings and inputs read differently; for a real setting, also the number that fits best.

    After MOST_BESIDE readings of one setting or input that change some of the wrong outputs, but not all, it is left.
    """
    while not trial.over and (request := next(readings, None)):
        if trial.beside.get(request.of, 0) >= MOST_BESIDE:
            continue
        with contextlib.suppress(Exception):
            if request.at is None and not trial.reached(request):
                trial.beside[request.of] = trial.beside.get(request.of, 0) + 1
                continue
            for one in [request] if request.at is None else _best_fixed(trial, request.at, request.rest):
                _read(trial, one)


def _read(trial: Trial, request: OtherReading) -> None:
    """Note a misreading that fits; where decisions are wrong, an expression is likelier than a number."""
    likely, less = request.rank
    trial.note(
        trial.fits(None, "both", request), request.text, None, likely + 2 * (trial.discrete and request.number), less
    )


def _exchanges(trial: Trial, places: Sequence[Statement]) -> None:
    """Two settings, two inputs, or two entries of a tuple in the definition exchanged; none in a trajectory.

    Tuples are exchanged if nothing else explains both passes.
    """
    if trial.length:
        return
    for request in exchanges([one.case for one in trial.cases]):
        if trial.over:
            return
        with contextlib.suppress(Exception):
            _read(trial, request)
    with trial.within(PART):
        for place in [] if trial.explains else places:
            _changes(trial, turned(place), 2)


def _best_fixed(trial: Trial, at: Callable[[float], OtherReading], rest: float) -> list[OtherReading]:
    """A setting fixed at the number that fits best and at plain numbers near it, if nothing else was found."""
    if trial.hits:
        return []
    numbers, _ = trial.number(lambda value: trial.outputs(None, "both", at(value)), rest)
    return [at(value) for value, _ in numbers]


def _reached(trial: Trial, places: Sequence[Statement], long: bool) -> list[Live]:
    """Reached spots, the most promising first: a small change there spoils the fewest of the right outputs.

    On the way, the factor, term or constant that fits best is tried at each; not for a trajectory, which is slow.
    """
    live: list[Live] = []
    for place in places:
        for spot in spots(place):
            for mode in trial.modes(place):
                if trial.over:
                    return live
                late = list[int]()
                if values := _values(trial, spot, mode, late if long else None):
                    rank = next(iter(late), UNKNOWN) if long else _solved(trial, spot, mode, values)
                    live.append(Live(spot, mode, values, rank))
    return sorted(live, key=lambda one: one.late)


def _values(trial: Trial, spot: Spot, mode: str, late: list[int] | None = None) -> list[Any]:
    """Values of an expression in the first case, None for one that is no number and no array; True for a statement.

    late   if given, real values are perturbed while they are read, and the number of spoiled outputs is stored here
    """
    if isinstance(spot.node, ast.stmt):
        return [True]
    found: list[Any] = []
    changed = False

    def seen(value: Any) -> Any:
        nonlocal changed
        if len(found) < MOST_VALUES:
            found.append(value if isinstance(value, bool | int | float | np.ndarray | np.generic) else None)
        if late is None or np.asarray(value).dtype.kind != "f":
            return value
        changed = True
        return np.multiply(value, 1 + START)

    spot.place.module.__dict__["_seen"] = seen
    with contextlib.suppress(Exception):
        with written(spot, f"_seen({ast.unparse(spot.node)})"):
            install = spot.place.compiled()
        moved = trial.outputs(install, mode)
        if late is not None and changed:
            late.append(trial.cases[0].spoiled(moved) if trial.moves(moved) else LATEST - 1)
    return found


def _solved(trial: Trial, spot: Spot, mode: str, values: list[Any]) -> int:
    """Search for the number at a spot that explains everything; returns the rank of other texts there.

    The rank is the number of right outputs of the first case that a small change spoils.
    """
    rank = 2 if isinstance(spot.node, ast.Constant) else 3
    texts = with_number(spot.node, values)
    return min((_number_at(trial, spot, mode, text, rest, rank) for text, rest in texts), default=LATEST)


def _number_at(trial: Trial, spot: Spot, mode: str, text: str, rest: float, rank: int, words: str = "") -> int:
    """As `_solved`, for one text."""
    names, counter = spot.place.module.__dict__, trial.counter
    try:
        with written(spot, text):
            made = spot.place.compiled()

        def install() -> Any:
            counter.count = 0
            return made()

        def outputs(value: float) -> Outputs:
            names["_knob"] = value
            return trial.outputs(install, mode)

        numbers, spoils = trial.number(outputs, rest)
        for value, plain in numbers:
            names["_knob"] = value
            whole, phases = trial.best(install, mode)
            if whole:
                when = words or (counter.words() if rank > 3 else "")
                said = _replaced(spot, phases, said_number(spot.node, rest, value), when)
                by_name = rest == 0 and isinstance(spot.node, ast.Name | ast.Attribute)  # rather another name
                stands = partial(_standing, spot, text.replace("_knob", f"({value!r})"))
                kept = stands if rank < 4 and (phases == mode) else None
                trial.note(whole, said, spot, 1 + (trial.discrete or by_name) if plain else 3, rank, standing=kept)
                break
    except Exception:  # a changed text may raise anything
        return LATEST
    return spoils


def _texts(one: Live, lower: str) -> Iterator[tuple[str, int]]:
    """Other texts of a spot, first those in a lower precision."""
    yield from rounded(one.spot.node, one.values, lower)
    yield from rewrites(one.spot.node, one.values, one.spot.truth)


def _names(one: Live, _lower: str) -> Iterator[tuple[str, int]]:
    """Names of the function in place of another name."""
    is_name = isinstance(one.spot.node, ast.Name | ast.Attribute)
    return ((name, 0) for name in (names_in(one.spot.place) if is_name else ()))


def _try(trial: Trial, one: Live, texts: Iterator[tuple[str, int]], rank: int) -> None:
    less_likely = trial.discrete and isinstance(one.spot.node, ast.Constant)
    for text, less in texts:
        if trial.over:
            return
        with contextlib.suppress(Exception):
            with written(one.spot, text):
                install = one.spot.place.compiled()
            whole, mode = trial.best(install, one.mode)
            kept = partial(_standing, one.spot, text) if mode == one.mode else None
            trial.note(whole, _replaced(one.spot, mode, text), one.spot, rank, less + less_likely, standing=kept)
            if whole == "forward":
                _changes(trial, in_both(one.spot, text, trial.live), rank)


@contextlib.contextmanager
def _standing(spot: Spot, text: str) -> Iterator[None]:
    """The definition with another text at a spot, for a search beside this change."""
    with written(spot, text), installed(spot.place.compiled()):
        yield


def _replaced(spot: Spot, mode: str, new: str, words: str = "") -> str:
    return f"`{new}` {f'{words} ' if words else ''}where `{ast.unparse(spot.node)}` is right{_side(spot, mode)}"


def _side(spot: Spot, mode: str) -> str:
    return "" if mode == "both" or len(spot.place.phases) == 1 else f", in the {mode} pass alone"


def _forms(trial: Trial, places: Sequence[Statement], live: Sequence[Live]) -> None:
    """Expressions of one form changed alike, and means of means, if nothing else explains both passes."""
    for place in places:
        of = [one for one in live if one.spot.place is place]
        if not trial.explains:
            _changes(trial, alike([(one.spot, one.values) for one in of]))
            _changes(trial, (change for one in of for change in in_operations(one.spot, names_in(place))))


def _second(trial: Trial, places: Sequence[Statement]) -> None:
    """Changes of more than one expression, of a part of an array and of the order.

    They are tried if nothing else explains both passes, and enough entries are wrong to tell them apart.
    """
    if trial.explains or trial.wrong < TELLING:
        return
    places = [place for place in places if trial.forward_refused or "reverse" in place.phases]
    live = sorted((one for one in trial.live if one.spot.place in places), key=lambda one: one.late)
    for place in places:
        _changes(trial, orders(place))
    for one in live if not trial.explains else ():
        for text, words in parts(one.spot, one.values):
            if not trial.over:
                _number_at(trial, one.spot, one.mode, text, 1.0, 4, words)
    for place in places if not trial.explains else ():
        _changes(trial, pairs([one.spot for one in live if one.spot.place is place]))
    for one in live if not trial.explains else ():
        _try(trial, one, beside(one.spot, one.values, expressions(one.spot.place)), 5)


def _changes(trial: Trial, changes: Iterator[SecondChange], rank: int = 4) -> None:
    for spot, text, writing, other in changes:
        if trial.over:
            return
        with contextlib.suppress(Exception):
            with writing:
                install = together([place.compiled() for place in (spot.place, other) if place])
            whole, mode = trial.best(install, "both" if other else trial.modes(spot.place)[0])
            if not other or (whole, mode) == ("all", "both"):  # of two passes, both are explained or nothing is said
                trial.note(whole, f"{text}{_side(spot, mode)}", spot, rank, 0)
