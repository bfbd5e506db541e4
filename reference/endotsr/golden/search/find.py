"""The search: every single change of the definition against the outputs of a port, within a number of seconds."""

import ast
import contextlib
import json
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.golden.judge.diagnose import made_of
from endotsr.golden.judge.format import Precision
from endotsr.golden.judge.store import Golden, in_precision
from endotsr.golden.judge.verdict import INSIDE, Report, judge, left_out
from endotsr.golden.search.cases import Answered
from endotsr.golden.search.numbers import START, best_number, plain_first, said_number
from endotsr.golden.search.places import Spot, Statement, definition_modules, executed, names_in, spots, written
from endotsr.golden.search.requests import OtherReading, other_requests
from endotsr.golden.search.rewrites import rewrites, with_number
from endotsr.golden.search.second import Counter, SecondChange, at, beside, expressions, orders, pairs, parts
from endotsr.stages.definition import definition_stages
from endotsr.stages.stage import Outputs, Stage

SECONDS = 16.0  # of computing that a search may take
START_UP = 60.0  # seconds that a process may take beside its search
SLOWEST = 10.0  # seconds that a second of computing may take on a busy machine
LATEST = 1000  # a spot of which it is not known what it reaches
ENOUGH = 40  # equal explanations after which the search ends
TELLING = 8  # wrong entries from which any number is believed, and outputs whose gradients are wrong otherwise
MOST_LINES = 3  # of the source that are named where all explain the outputs equally
MOST_VALUES = 64  # of an expression, that are looked at
WHOLE = {
    "all": "every output",
    "derivative": "every forward output, of which the gradients of the port are the derivatives,",
    "refused": "every output of those that are refused; it would be wrong in others that pass,",
    "forward": "every forward output; the gradients of the port are wrong in another way,",
}
"""What a change explains, the most first."""
Install = Callable[[], Any]  # makes a change and returns what takes it back


class Hit(NamedTuple):
    """A change with which the definition gives what the port wrote."""

    text: str
    where: str  # equation and line
    function: str  # in which the line stands
    whole: str  # a key of WHOLE
    rank: tuple[int, ...]


class Live(NamedTuple):
    """A spot, a phase, its values, and how late it is tried: by the outputs that passed and that a change spoils."""

    spot: Spot
    mode: str
    values: list[Any]
    late: int


class Search:
    """The search for one operation: its cases, of which the first has the most refused outputs, and what was found."""

    def __init__(self, stage: Stage, answered: Sequence[Answered], golden: Golden, seconds: float) -> None:
        self.stage, self.cases, self.end = stage, answered, time.process_time() + seconds
        self.golden = golden
        self.hits: list[Hit] = []
        self.live: list[Live] = []
        self.counter = Counter()
        self.tried = 0
        self.matched = False  # the change tried last gives the forward outputs of a case in which one is refused
        for one in answered:
            one.begin(stage)
        first = answered[0]
        real = [name for name in sorted(first.refused) if first.case.outputs[name].dtype == "real"]
        self.real = [name for name in real if name in first.ahead] or real  # that a number is sought by
        # decisions are refused: other numbers may well make the same ones
        self.discrete = any(one.case.outputs[name].dtype != "real" for one in answered for name in one.refused)
        self.refusals = [one.refused for one in answered]
        self.wrong = sum(one.wrong(one.ahead + one.back) for one in answered)
        self.wrong_ahead = sum(one.wrong(one.ahead) for one in answered)
        self.ahead = any(one.refused & set(one.ahead) for one in answered)  # a forward output is refused
        self.back = any(one.refused & set(one.back) for one in answered)

    @property
    def over(self) -> bool:
        """Whether time is up, or enough is found."""
        return time.process_time() > self.end or len(self.hits) >= ENOUGH

    @property
    def explains(self) -> bool:
        """Whether a change explains both passes."""
        return any(hit.whole in ("all", "derivative") for hit in self.hits)

    def fits(self, install: Install | None, mode: str, request: OtherReading | None = None) -> str:
        """How much of all cases a change explains: a key of WHOLE, or "" for nothing."""
        self.tried += 1
        self.matched = False
        gradients: list[bool | None] = []  # of cases whose gradients are not those of the definition with the change
        spoils = False  # a case that passed
        for one in self.cases:
            if spoils:
                break
            inputs, settings = request.ask(one.inputs, one.settings) if request else (one.inputs, one.settings)
            found, saved = one.right, one.saved
            if mode != "reverse":
                with _installed(install):
                    found, saved = one.forward(self.stage, inputs, settings)
            same = one.same(request.tell(found) if request else found, one.ahead)
            if not same and one.refused:
                return ""
            self.matched |= same and bool(one.refused.intersection(one.ahead))
            if same and one.back and False not in gradients and (one.refused or not gradients):
                with _installed(install if mode != "forward" else None):
                    back = one.reverse(self.stage, inputs, saved)
                same = one.same(request.tell(back) if request else back, one.back)
                if not same and one.refused:
                    if mode == "reverse" or not self.ahead:
                        return ""
                    with _installed(install):
                        gradients.append(one.is_derivative(self.stage))
            spoils = spoils or (not same and not one.refused)
        if gradients and spoils:
            return ""
        if gradients:
            return "derivative" if True in gradients and False not in gradients else "forward"
        return "refused" if spoils else "all"

    def best(self, install: Install, mode: str) -> tuple[str, str]:
        """The same, and the phases of it: a change of both may explain more if the reverse pass does without."""
        whole = self.fits(install, mode)
        if mode == "both" and whole != "all" and self.matched:
            alone, order = self.fits(install, "forward"), list(WHOLE)
            if alone and (not whole or order.index(alone) < order.index(whole)):
                return alone, "forward"
        return whole, mode

    def outputs(self, install: Install | None, mode: str, request: OtherReading | None = None) -> Outputs:
        """All outputs of the first case with a change."""
        one = self.cases[0]
        self.tried += 1
        inputs, settings = request.ask(one.inputs, one.settings) if request else (one.inputs, one.settings)
        found, saved = one.right, one.saved
        if mode != "reverse":
            with _installed(install):
                found, saved = one.forward(self.stage, inputs, settings)
        with _installed(install if mode != "forward" else None):
            return {**found, **one.reverse(self.stage, inputs, saved)}

    def number(self, at: Callable[[float], Outputs], rest: float) -> tuple[list[tuple[float, bool]], int]:
        """Numbers to try, the plainest first, and how many outputs that passed another number spoils."""
        one = self.cases[0]

        def off(value: float) -> Any:
            return one.distance(at(value), self.real)

        moved = at(rest + START * (abs(rest) or 1.0))
        number = best_number(off, rest, one.distance(one.right, self.real)) if self.real else None
        late = sum(not one.same(moved, [name]) for name in one.got if name not in one.refused)
        changes = not all(np.array_equal(moved[name], one.right[name]) for name in one.got)
        known = number is not None and abs(number - rest) > START
        numbers = plain_first(number) if number is not None and known else []
        numbers = [one for one in numbers if one[1] or self.wrong >= TELLING]
        return numbers, late if changes else LATEST - 1

    def note(self, whole: str, text: str, spot: Spot | None, *rank: int) -> None:
        """Keep a change that fits."""
        enough = {"forward": self.wrong_ahead, "refused": self.wrong if sum(map(bool, self.refusals)) > 1 else 0}
        if whole and enough.get(whole, TELLING) >= TELLING:
            if spot and not self.ahead and spot.place.phases == {"forward"}:
                rank = (rank[0] + 1, *rank[1:])  # what is refused is computed elsewhere
            where, function = (spot.place.where(spot.node), spot.place.name) if spot else ("", text)
            self.hits.append(Hit(text, where, function, whole, (int(whole in enough), *rank, len(self.hits))))

    def modes(self, place: Statement) -> list[str]:
        """The phases in which a change of a place can make what is refused."""
        if len(place.phases) == 1:
            return list(place.phases)
        return ["both" if self.ahead else "reverse"]


@contextlib.contextmanager
def _installed(install: Install | None) -> Iterator[None]:
    back = install() if install else None
    try:
        yield
    finally:
        if back:
            back()


def search(stage: Stage, answered: Sequence[Answered], golden: Golden, seconds: float = SECONDS) -> Search:
    """Changes of one operation that explain what a port wrote, best first in `hits`."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found = Search(stage, answered, golden, seconds)
        calls: dict[str, Callable[[], Any]] = {
            "forward": lambda: [one.forward(stage, one.inputs, one.settings) for one in answered],
            "reverse": lambda: [one.reverse(stage, one.inputs, one.saved) for one in answered],
        }
        places = executed(calls)
        inner = _inner(stage.name, golden)
        glue = [place for place in places if inner and not place.is_constant and place.name not in inner]
        _places(found, glue)
        _requests(found)
        _places(found, [place for place in places if not place.is_constant and place not in glue])
        _places(found, [place for place in places if place.is_constant])
        _second(found, [place for place in (glue or places) if not place.is_constant])
    for module in definition_modules():
        for name in ("_knob", "_seen", "_at", "_nth"):
            module.__dict__.pop(name, None)
    found.hits.sort(key=lambda hit: hit.rank)
    return found


def _inner(operation: str, golden: Golden) -> set[str]:
    """Functions of the definition that the parts of an operation execute; these parts are right."""
    stages = definition_stages()
    parts = made_of(operation) & stages.keys()
    cases = {case.operation: case for case in golden.cases if case.operation in parts}
    calls = {
        part: lambda part=part: stages[part].compute(
            in_precision(golden.inputs(cases[part]), "float64"), cases[part].settings
        )
        for part in parts & cases.keys()
    }
    return {place.name for place in executed(calls)}


def _places(search: Search, places: Sequence[Statement]) -> None:
    """Changes of some places: numbers, then other texts, then other names."""
    live = _numbers(search, places)
    search.live += live
    for texts, rank in ((_texts, 1), (_names, 2)):
        lines = {hit.where for hit in search.hits if hit.rank[:2] < (0, 2) and not search.discrete}
        for one in live:  # once something is found, the rest of its line is tried
            if not lines or one.spot.place.where(one.spot.node) in lines:
                _try(search, one, texts(one), rank)


def _requests(search: Search) -> None:
    """Settings and inputs that are taken otherwise; where a setting is a number, also the one that fits best."""
    for request in other_requests([one.case for one in search.cases], search.golden.cases):
        if search.over:
            return
        with contextlib.suppress(Exception):
            for one in [request] if request.at is None else _best_fixed(search, request.at, request.rest):
                search.note(search.fits(None, "both", one), one.text, None, *one.rank)


def _best_fixed(search: Search, at: Callable[[float], OtherReading], rest: float) -> list[OtherReading]:
    """A setting fixed at the number that fits best, if nothing else was found."""
    if search.hits:
        return []
    numbers, _ = search.number(lambda value: search.outputs(None, "both", at(value)), rest)
    return [at(value) for value, _ in numbers]


def _numbers(search: Search, places: Sequence[Statement]) -> list[Live]:
    """Factors, terms and constants of another size; returns the spots that are reached, the most promising first."""
    live: list[Live] = []
    for place in places:
        for spot in spots(place):
            for mode in search.modes(place):
                if search.over:
                    return live
                if values := _values(search, spot, mode):
                    live.append(Live(spot, mode, values, _solved(search, spot, mode, values)))
    return sorted(live, key=lambda one: one.late)


def _values(search: Search, spot: Spot, mode: str) -> list[Any]:
    """Values of an expression in the first case, None for one that is no array; a statement has True."""
    if isinstance(spot.node, ast.stmt):
        return [True]
    found: list[Any] = []

    def seen(value: Any) -> Any:
        if len(found) < MOST_VALUES:
            found.append(value if isinstance(value, bool | int | float | np.ndarray | np.generic) else None)
        return value

    spot.place.module.__dict__["_seen"] = seen
    with contextlib.suppress(Exception):
        with written(spot, f"_seen({ast.unparse(spot.node)})"):
            install = spot.place.compiled()
        search.outputs(install, mode)
    return found


def _solved(search: Search, spot: Spot, mode: str, values: list[Any]) -> int:
    """Look for the number at a spot with which all is explained; returns how late other texts are tried there."""
    late = LATEST
    for text, rest in with_number(spot.node, values):
        late = min(late, _number_at(search, spot, mode, text, rest, 2 if isinstance(spot.node, ast.Constant) else 3))
    return late


def _number_at(search: Search, spot: Spot, mode: str, text: str, rest: float, rank: int, words: str = "") -> int:
    """The same for one text."""
    names, counter = spot.place.module.__dict__, search.counter
    try:
        with written(spot, text):
            made = spot.place.compiled()

        def install() -> Any:
            counter.count = 0
            return made()

        def outputs(value: float) -> Outputs:
            names["_knob"] = value
            return search.outputs(install, mode)

        numbers, spoils = search.number(outputs, rest)
        for value, plain in numbers:
            names["_knob"] = value
            whole, phases = search.best(install, mode)
            if whole:
                when = words or (f"at {counter.words()}" if rank > 3 else "")
                said = _replaced(spot, phases, said_number(spot.node, rest, value), when)
                by_name = rest == 0 and isinstance(spot.node, ast.Name | ast.Attribute)  # rather another name
                search.note(whole, said, spot, 1 + (search.discrete or by_name) if plain else 3, rank)
                break
    except Exception:  # whatever the changed text does
        return LATEST
    return spoils


def _texts(one: Live) -> Iterator[tuple[str, int]]:
    """Other texts of a spot."""
    return rewrites(one.spot.node, one.values, one.spot.truth)


def _names(one: Live) -> Iterator[tuple[str, int]]:
    """Another array or number of the function in place of one."""
    is_name = isinstance(one.spot.node, ast.Name | ast.Attribute)
    return ((name, 0) for name in (names_in(one.spot.place) if is_name else ()))


def _try(search: Search, one: Live, texts: Iterator[tuple[str, int]], rank: int) -> None:
    less_likely = search.discrete and isinstance(one.spot.node, ast.Constant)
    for text, less in texts:
        if search.over:
            return
        with contextlib.suppress(Exception):
            with written(one.spot, text):
                install = one.spot.place.compiled()
            whole, mode = search.best(install, one.mode)
            search.note(whole, _replaced(one.spot, mode, text), one.spot, rank, less + less_likely)


def _replaced(spot: Spot, mode: str, new: str, words: str = "") -> str:
    return f"`{new}` {f'{words} ' if words else ''}where `{ast.unparse(spot.node)}` is right{_side(spot, mode)}"


def _side(spot: Spot, mode: str) -> str:
    return "" if mode == "both" or len(spot.place.phases) == 1 else f", in the {mode} pass alone"


def _second(search: Search, places: Sequence[Statement]) -> None:
    """Changes of more than one expression, of a part of an array and of the order, where nothing else fits."""
    if search.explains or search.wrong < TELLING:
        return
    for module in definition_modules():
        module.__dict__.update(_at=at, _nth=search.counter.nth)
    places = [place for place in places if search.ahead or "reverse" in place.phases]
    live = sorted((one for one in search.live if one.spot.place in places), key=lambda one: one.late)
    for place in places:
        _changes(search, orders(place))
    for one in live if not search.explains else ():
        for text, words in parts(one.spot, one.values):
            if not search.over:
                _number_at(search, one.spot, one.mode, text, 1.0, 4, words)
    for place in places if not search.explains else ():
        _changes(search, pairs([one.spot for one in live if one.spot.place is place]))
    for one in live if not search.explains else ():
        _try(search, one, beside(one.spot, one.values, expressions(one.spot.place)), 5)


def _changes(search: Search, changes: Iterator[SecondChange]) -> None:
    for spot, text, writing in changes:
        if search.over:
            return
        with contextlib.suppress(Exception):
            with writing:
                install = spot.place.compiled()
            whole, mode = search.best(install, search.modes(spot.place)[0])
            search.note(whole, f"{text}{_side(spot, mode)}", spot, 4, 0)


def explained(
    golden: Golden, outputs: Path, precision: Precision, level: int, operation: str, seconds: float
) -> Search:
    """The search for the mistake of an operation, of which an output is refused.

    Raises: InputError for one that the definition does not compute, or of which nothing that could be read is refused.
    """
    stage = definition_stages().get(operation)
    cases = [case for case in golden.cases if case.operation == operation and case.level <= level]
    reports = judge(golden._replace(cases=cases), outputs, precision, level=min(level, 4)).cases
    answered = [Answered(golden, *pair, outputs, precision) for pair in zip(cases, reports)]
    answered = [one for one in answered if one.got]
    answered.sort(key=lambda one: (-len(one.refused), -sum(one.got[name].size for name in one.refused)))
    if stage is None or not answered or not answered[0].refused:
        raise InputError(f"{operation}: nothing to explain")
    return search(stage, answered, golden, seconds)


def explain(golden: Golden, report: Report, outputs: Path, seconds: float = SECONDS) -> None:
    """Write into a report what a search for the mistake of its first wrong operation finds.

    It runs in a process of its own: a change may ask for more memory than there is, or call a library wrongly.
    """
    if not report.first_wrong:
        return
    words = [golden.folder, outputs, report.precision, report.asked_level, report.first_wrong, seconds]
    limit = START_UP + SLOWEST * seconds
    with contextlib.suppress(subprocess.TimeoutExpired):
        done = subprocess.run([sys.executable, "-m", "endotsr.golden.search", *map(str, words)],
                              capture_output=True, timeout=limit, check=False)  # fmt: skip
        if done.returncode == 0:
            found = json.loads(done.stdout)
            report.causes, report.inside = found["causes"], found["inside"]
            unasked = report.causes or INSIDE in left_out(outputs)[0]
            report.notes += [found["asked"]] if found["asked"] and not unasked else []


def sentences(search: Search) -> list[str]:
    """The changes that explain most, one a line of the source; nothing where changes in many functions do."""
    best: dict[str, Hit] = {}
    for hit in search.hits:
        if hit.rank[:3] == search.hits[0].rank[:3]:
            best.setdefault(hit.where or hit.text, hit)
    functions = sorted({hit.function for hit in best.values()})
    if not best or len(functions) > MOST_LINES:
        return []
    said = [f"{hit.text}{f': {hit.where}' if hit.where else ''}" for hit in best.values()]
    rest = [f"  or equally with {one}" for one in said[1:]]
    if len(best) > MOST_LINES:
        said[0] = f"for example {said[0]}"
        rest = [f"  or equally with another change in {', '.join(functions)}: {len(best)} lines"]
    number = len(search.cases)
    whole = f"  ({WHOLE[search.hits[0].whole]} of its {number} case{'s' * (number > 1)})"
    return [f"your outputs are those of the definition with {said[0]}", *rest, whole]
