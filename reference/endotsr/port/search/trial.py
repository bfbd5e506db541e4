"""One operation, the outputs of a port, and the extent to which a change of the definition explains them.

In: the cases of the operation with the port's answers. Out: the explanations of the changes, in `hits`. `changes.py`
selects the changes.
"""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

import numpy as np

from endotsr.port.judge.store import Golden
from endotsr.port.operations.operation import Operation, Outputs
from endotsr.port.search.cases import Answered
from endotsr.port.search.numbers import START, best_number, plain_first
from endotsr.port.search.places import Spot, Statement
from endotsr.port.search.requests import OtherReading
from endotsr.port.search.second import Counter

LATEST = 1000  # rank of a spot with unknown reach
UNREACHED = 1001  # rank of a spot at which a small change leaves a wrong output as it is
ENOUGH = 40  # equal explanations that end the search
MOST = 3  # smallest number of explained cases with refused outputs beside which one may stay unexplained
TELLING = 8  # smallest number of wrong entries for which any number, or an explanation of a part, is accepted
WHOLE = {
    "all": "every output",
    "derivative": "every forward output, of which the gradients of the port are the derivatives,",
    "refused": "every output of those that are refused; it would be wrong in others that pass,",
    "forward": "every forward output; the gradients of the port are wrong in another way,",
    "most": "every output, except in {unlike},",
}
"""Extents of an explanation."""
Install = Callable[[], Any]  # applies a change and returns a function that undoes it
Standing = Callable[[], AbstractContextManager[Any]]  # a context in which a change is in force


class Hit(NamedTuple):
    """A change with which the definition reproduces the port's outputs."""

    text: str
    where: str  # equation and line
    function: str  # of the line
    whole: str  # a key of WHOLE
    rank: tuple[int, ...]
    unlike: str = ""  # for `most`, the case that stays unexplained
    standing: Standing | None = None  # for a change of an expression in all its phases

    @property
    def extent(self) -> str:
        """How much is explained, in words."""
        return WHOLE[self.whole].format(unlike=self.unlike)


class Live(NamedTuple):
    """A spot, a phase, its values, and its rank: the number of passed outputs that a change spoils."""

    spot: Spot
    mode: str
    values: list[Any]
    late: int


class Trial:
    """The search for one operation: its cases, in the order of `find.explained`, and the hits."""

    def __init__(self, operation: Operation, answered: Sequence[Answered], golden: Golden, seconds: float) -> None:
        self.operation, self.cases, self.end = operation, answered, time.process_time() + seconds
        self.golden = golden
        self.length = max((one.length for one in answered), default=0)  # of trajectories, which are slow
        self.hits: list[Hit] = []
        self.live: list[Live] = []
        self.counter = Counter()
        self.tried = 0
        self.beside: dict[str, int] = {}  # readings of a setting or input that leave a wrong output as it is
        self.unlike = ""  # the refused case that the last change does not explain, if it explains the others
        self.matched = False  # the last change reproduces the forward outputs of a case with a refused one
        for one in answered:
            one.begin(operation)
        most = answered[0]
        self.lower = lower_precision(most)
        real = [name for name in sorted(most.refused) if most.case.outputs[name].dtype == "real"]
        self.fitted = [name for name in real if name in most.forward_names] or real  # outputs for fitting a number
        # decisions are refused: other numbers may give the same decisions
        self.discrete = any(one.case.outputs[name].dtype != "real" for one in answered for name in one.refused)
        self.refusals = [one.refused for one in answered]
        self.wrong = sum(one.wrong(one.forward_names + one.gradient_names) for one in answered)
        self.wrong_forward = sum(one.wrong(one.forward_names) for one in answered)
        self.forward_refused = any(
            one.refused & set(one.forward_names) for one in answered
        )  # a forward output is refused

    @property
    def over(self) -> bool:
        """Whether the time is over or enough has been found."""
        return time.process_time() > self.end or len(self.hits) >= ENOUGH

    @contextlib.contextmanager
    def within(self, part: float) -> Iterator[None]:
        """A context in which a part of the time that is left is at hand."""
        end, now = self.end, time.process_time()
        self.end = min(end, now + part * (end - now))
        try:
            yield
        finally:
            self.end = end

    @property
    def explains(self) -> bool:
        """Whether a change explains both passes."""
        return any(hit.whole in ("all", "derivative") for hit in self.hits)

    def fits(self, install: Install | None, mode: str, request: OtherReading | None = None) -> str:
        """The extent to which a change explains all cases: a key of WHOLE, or "" for nothing.

        A port may do more than one thing otherwise where an optional part is on: after MOST explained cases, one may
        stay unexplained, if no gradients differ.
        """
        self.tried += 1
        self.matched = False
        gradients: list[bool | None] = []  # of cases with gradients that differ from the changed definition's
        spoils = False  # a case that passed
        explained, self.unlike = 0, ""  # cases with refused outputs; one of them where the port does something else
        for one in self.cases:
            if spoils:
                break
            inputs, settings = request.ask(one.inputs, one.settings) if request else (one.inputs, one.settings)
            found, saved = one.right, one.saved
            if mode != "reverse":
                with installed(install):
                    found, saved = one.forward(self.operation, inputs, settings)
            same = one.same(request.tell(found) if request else found, one.forward_names)
            if not same and one.refused:
                if self.unlike or explained < MOST:
                    return ""
                self.unlike = one.case.name
                continue
            explained += same and bool(one.refused)
            self.matched |= same and bool(one.refused.intersection(one.forward_names))
            if same and one.gradient_names and False not in gradients and (one.refused or not gradients):
                with installed(install if mode != "forward" else None):
                    back = one.reverse(self.operation, inputs, saved)
                same = one.same(request.tell(back) if request else back, one.gradient_names)
                if not same and one.refused:
                    if mode == "reverse" or not self.forward_refused:
                        return ""
                    with installed(install):
                        gradients.append(one.is_derivative(self.operation))
            spoils = spoils or (not same and not one.refused)
        if self.unlike:
            return "" if gradients or spoils else "most"
        if gradients and spoils:
            return ""
        if gradients:
            return "derivative" if True in gradients and False not in gradients else "forward"
        return "refused" if spoils else "all"

    def best(self, install: Install, mode: str) -> tuple[str, str]:
        """As `fits`, with the best phases: a change of both may explain more without the reverse pass."""
        whole = self.fits(install, mode)
        if mode == "both" and whole not in ("all", "most") and self.matched:
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
            with installed(install):
                found, saved = one.forward(self.operation, inputs, settings)
        with installed(install if mode != "forward" else None):
            return {**found, **one.reverse(self.operation, inputs, saved)}

    def number(self, at: Callable[[float], Outputs], rest: float) -> tuple[list[tuple[float, bool]], int]:
        """Numbers to try, as `plain_first` orders them, and the number of right outputs that a small step spoils.

        That number is LATEST - 1 if the step changes nothing, and UNREACHED if it leaves a wrong output as it is.
        """
        one = self.cases[0]

        def off(value: float) -> Any:
            return one.distance(at(value), self.fitted)

        moved = at(rest + START * (abs(rest) or 1.0) if self.fitted else np.nan)
        if not self.reaches(moved):
            return [], UNREACHED if self.moves(moved) or not self.fitted else LATEST - 1
        if not self.fitted:
            return [], LATEST - 1
        number = best_number(off, rest, one.distance(one.right, self.fitted))
        known = number is not None and abs(number - rest) > START
        numbers = plain_first(number) if number is not None and known else []
        return [one for one in numbers if one[1] or self.wrong >= TELLING], one.spoiled(moved)

    def reached(self, request: OtherReading) -> bool:
        """Whether a misreading changes the wrong outputs of the first case, in the pass that is to be explained."""
        one = self.cases[0]
        forward, saved = one.forward(self.operation, *request.ask(one.inputs, one.settings))
        return self.reaches(
            request.tell(forward if self.forward_refused else one.reverse(self.operation, one.inputs, saved))
        )

    def reaches(self, found: Outputs) -> bool:
        """Whether each output by which a number is fitted differs from the definition's; without any, a refused one."""
        one = self.cases[0]
        names = self.fitted or one.refused
        moved = (name in found and not np.array_equal(found[name], one.right[name]) for name in names)
        return all(moved) if self.fitted else any(moved)

    def moves(self, found: Outputs) -> bool:
        """Whether these outputs of the first case differ from the definition's."""
        one = self.cases[0]
        return not all(np.array_equal(found[name], one.right[name]) for name in one.got)

    def note(self, whole: str, text: str, spot: Spot | None, *rank: int, standing: Standing | None = None) -> None:
        """Record a change that fits; one that explains a part alone, if at least TELLING entries are wrong there."""
        several = sum(map(bool, self.refusals)) > 1
        enough = {"forward": self.wrong_forward, "refused": self.wrong if several else 0, "most": self.wrong_forward}
        if whole and enough.get(whole, TELLING) >= TELLING:
            if spot and not self.forward_refused and spot.place.phases == {"forward"}:
                rank = (rank[0] + 1, *rank[1:])  # the refused outputs are computed elsewhere
            where, function = (spot.place.where(spot.node), spot.place.name) if spot else ("", text)
            extent = int(whole in enough) + (whole == "most")
            self.hits.append(Hit(text, where, function, whole, (extent, *rank, len(self.hits)), self.unlike, standing))

    def modes(self, place: Statement) -> list[str]:
        """The phases in which a change of a place can affect the refused outputs."""
        if len(place.phases) == 1:
            return list(place.phases)
        return ["both" if self.forward_refused else "reverse"]


LOWER = {"float32": (1e-11, 1e-6), "float16": (1e-6, 1e-2)}  # sizes of the largest error, relative to the output


def lower_precision(one: Answered) -> str:
    """The precision whose rounding errors have the size of those of a case, "" for none."""
    off = one.distance(one.right, [name for name in sorted(one.refused) if one.case.outputs[name].dtype == "real"])
    largest = 0.0 if off is None or not off.size else float(np.abs(off).max())
    return next((name for name, (low, high) in LOWER.items() if low < largest <= high), "")


@contextlib.contextmanager
def installed(install: Install | None) -> Iterator[None]:
    """The definition with a change in force; None changes nothing."""
    back = install() if install else None
    try:
        yield
    finally:
        if back:
            back()
