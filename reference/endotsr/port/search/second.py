"""Changes of more than one expression, most of them tried if no other explains both passes.

Two entries of a tuple exchanged; two numbers of one line; expressions of one form changed alike; a mean of means;
another order of statements; an expression of the function that replaces another or is combined with it; a factor at
one index of an array, or at one evaluation of an expression.
"""

import ast
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from copy import deepcopy
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.search.places import Spot, Statement, written
from endotsr.port.search.rewrites import is_real, rewrites

MOST_INDICES = 16  # longest first axis of an array of which every index is tried
MOST_INNER = 4  # longest second axis
FUNCTIONS = ("sum", "mean", "max", "min", "any", "all", "T", "real")  # methods of arrays
LONGEST = 24  # characters of a moved expression
BESIDE = ("({t}) * ({e})", "({t}) / ({e})", "({t}) * (1 - ({e}))", "({t}) + ({e})", "({t}) - ({e})")
BESIDE_TRUE = ("({t}) & ({e})", "({t}) | ({e})", "({t}) & ~({e})")


class SecondChange(NamedTuple):
    """A change of one or two places, its description, and the context that applies it."""

    spot: Spot
    text: str
    writing: AbstractContextManager
    other: Statement | None = None


def in_both(spot: Spot, text: str, live: Sequence[Any]) -> Iterator[SecondChange]:
    """The same text for the same expression of a function of the reverse pass in the same module.

    live   the spots that are reached
    """
    same: dict[str, Spot] = {}
    for other in (one.spot for one in live):
        place = other.place
        if place.phases == {"reverse"} and place.module is spot.place.module and _equal(other.node, spot.node):
            if place.name not in same or len(other.holders) > len(same[place.name].holders):
                same[place.name] = other
    for name, other in same.items():
        said = f"`{text}` where `{ast.unparse(spot.node)}` is right, and the same in {name.partition('.')[2]}"
        yield SecondChange(spot, said, _both((spot, text), (other, text)), other.place)


def _equal(one: ast.AST, other: ast.AST) -> bool:
    return ast.dump(one) == ast.dump(other)


def pairs(spots: Sequence[Spot]) -> Iterator[SecondChange]:
    """Two numbers of one line, both changed."""
    numbers = [s for s in spots if _is_number(s.node) and len(s.holders) == 1]
    for one, other in combinations(numbers, 2):
        if one.node.lineno != other.node.lineno:
            continue
        for first in _values_near(one.node):
            for second in _values_near(other.node):
                text = f"`{first}` where `{ast.unparse(one.node)}` is right, and `{second}` where "
                yield SecondChange(one, f"{text}`{ast.unparse(other.node)}` is", _both((one, first), (other, second)))


def _is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def _values_near(node: Any) -> list[str]:
    v = node.value
    return [repr(k) for k in dict.fromkeys((1, 2, 3, v + 1, v - 1, 2 * v, v / 2, 0)) if k != v]


def turned(place: Statement) -> Iterator[SecondChange]:
    """Two entries of a tuple or list exchanged."""
    for holder in ast.walk(place.statement):
        if isinstance(holder, ast.Tuple | ast.List) and len(holder.elts) <= MOST_INDICES:
            for k, to in combinations(range(len(holder.elts)), 2):
                one, other = ast.unparse(holder.elts[k]), ast.unparse(holder.elts[to])
                if one != other:
                    spot = Spot(place, holder.elts[k], ((holder, "elts", k),))
                    text = f"`{one}` and `{other}` exchanged"
                    yield SecondChange(spot, text, _exchanged(holder.elts, k, to))


@contextmanager
def _exchanged(entries: list[ast.expr], k: int, to: int) -> Iterator[None]:
    entries[k], entries[to] = entries[to], entries[k]
    try:
        yield
    finally:
        entries[k], entries[to] = entries[to], entries[k]


@contextmanager
def _both(*changes: tuple[Spot, str]) -> Iterator[None]:
    with ExitStack() as stack:
        for spot, text in changes:
            stack.enter_context(written(spot, text))
        yield


def alike(spots: Sequence[tuple[Spot, Sequence[Any]]]) -> Iterator[SecondChange]:
    """Two or three expressions of one form, such as those of columns and rows, changed in the same way.

    spots   with the observed values of each

    The form is the expression without its names and indices.
    """
    groups: dict[str, dict[str, tuple[Spot, Sequence[Any]]]] = {}
    for spot, values in sorted(spots, key=lambda one: len(one[0].holders)):
        if isinstance(spot.node, ast.BinOp | ast.Call | ast.Compare | ast.UnaryOp | ast.IfExp):
            groups.setdefault(_form(spot.node), {})[ast.unparse(spot.node)] = spot, values
    for group in groups.values():
        if len(group) not in (2, 3):
            continue
        texts = [[text for text, _ in rewrites(spot.node, values, spot.truth)] for spot, values in group.values()]
        if len(set(map(len, texts))) > 1:
            continue
        for together in zip(*texts):
            changes = [(spot, text) for (spot, _), text in zip(group.values(), together)]
            said = ", and ".join(f"`{text}` where `{ast.unparse(spot.node)}` is right" for spot, text in changes)
            yield SecondChange(changes[0][0], said, _both(*changes))


def _form(node: ast.AST) -> str:
    """The structure of an expression, without names, attributes of names other than `np`, and indices."""
    found = deepcopy(node)
    for one in ast.walk(found):
        if isinstance(one, ast.Subscript):
            for index in ast.walk(one.slice):
                if isinstance(index, ast.Constant):
                    index.value = 0
        elif isinstance(one, ast.Attribute) and isinstance(one.value, ast.Name) and one.value.id != "np":
            one.attr = "any" if one.attr not in FUNCTIONS else one.attr
    for one in ast.walk(found):
        if isinstance(one, ast.Name) and one.id != "np":
            one.id = "any"
    return ast.dump(found)


def in_operations(spot: Spot, names: Sequence[str]) -> Iterator[SecondChange]:
    """A sum divided by a count as the mean along one axis of the means there, over the entries of a mask.

    names   those of the function; a mask is an array of booleans among them
    """
    match spot.node:
        case ast.BinOp(left=ast.Call(func=ast.Attribute(attr="sum", value=summed), args=[], keywords=[]), op=ast.Div()):
            for name in names:
                for axis in (-1, -2, -3):
                    text = (
                        f"the mean of means along axis {axis}, over `{name}`, where `{ast.unparse(spot.node)}` is right"
                    )
                    yield SecondChange(
                        spot, text, written(spot, f"_mean_of_means({ast.unparse(summed)}, {name}, {axis})")
                    )


def mean_of_means(values: NDArray, mask: NDArray, axis: int) -> float:
    """The mean along an axis of the sums there by their numbers of True entries, without those of none; 0 if all are.

    Raises: TypeError if the mask has no booleans.
    """
    if np.asarray(mask).dtype.kind != "b":
        raise TypeError("mask: no booleans")
    others = tuple(k for k in range(-values.ndim, 0) if k != axis)
    counts = np.broadcast_to(mask, values.shape).sum(axis=others)
    any_there = counts > 0
    return float((values.sum(axis=others)[any_there] / counts[any_there]).mean()) if any_there.any() else 0.0


def orders(place: Statement) -> Iterator[SecondChange]:
    """An assignment moved to another place in the body of its function or loop."""
    for holder in ast.walk(place.statement):
        block = getattr(holder, "body", None)
        if not isinstance(block, list) or not isinstance(holder, ast.FunctionDef | ast.For):
            continue
        for k, node in enumerate(list(block)):
            for to in range(len(block)):
                if to != k and isinstance(node, ast.Assign | ast.AugAssign) and isinstance(block[to], ast.stmt):
                    side, spot = "before" if to < k else "after", Spot(place, node, ((holder, "body", k),))
                    text = f"`{ast.unparse(node)}` {side} `{ast.unparse(block[to])}`"
                    yield SecondChange(spot, text, _moved(block, k, to))


@contextmanager
def _moved(block: list[ast.stmt], at: int, to: int) -> Iterator[None]:
    block.insert(to, block.pop(at))
    try:
        yield
    finally:
        block.insert(at, block.pop(to))


def expressions(place: Statement) -> list[str]:
    """Short expressions read by a function."""
    kinds = ast.Name | ast.Attribute | ast.Subscript | ast.Compare | ast.BinOp
    nodes = (n for n in ast.walk(place.statement) if isinstance(n, kinds))
    read = (ast.unparse(n) for n in nodes if isinstance(getattr(n, "ctx", ast.Load()), ast.Load))
    return [text for text in dict.fromkeys(read) if len(text) <= LONGEST and not text.startswith("np")]


def beside(spot: Spot, values: Sequence[Any], others: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Texts for a spot with another expression of the function, in its place or combined with it."""
    holder, field, _ = spot.holders[0]
    if isinstance(spot.node, ast.stmt | ast.Constant):
        return
    inside = isinstance(holder, ast.BinOp) and isinstance(holder.op, ast.Mult | ast.Div) and field == "left"
    patterns = BESIDE_TRUE if spot.truth else () if inside or not any(map(is_real, values)) else BESIDE
    text = ast.unparse(spot.node)
    for other in others:
        if other != text:
            yield other, 0
            yield from ((pattern.format(t=text, e=other), 1) for pattern in patterns)


def parts(spot: Spot, values: Sequence[Any]) -> Iterator[tuple[str, str]]:
    """Texts with a factor `_knob` at one index or one evaluation of a real expression, and their description."""
    if isinstance(spot.node, ast.stmt) or len(spot.holders) > 1 or not all(map(is_real, values)):
        return
    text, shape = ast.unparse(spot.node), np.shape(values[0])
    if len(shape) > 1 and 1 < shape[0] <= MOST_INDICES:
        deep = len(shape) > 2 and shape[1] <= MOST_INNER
        for index in np.ndindex(shape[: 1 + deep]):
            yield f"_at({text}, {index}, _knob)", f"at {list(index)}"
    if len(values) > 1:
        for k in range(len(values)):
            yield f"_nth({text}, {k}, _knob)", ""


class Counter:
    """Counts the evaluations of an expression, and records the local integers of its function at one of them."""

    def __init__(self) -> None:
        self.count, self.numbers = 0, dict[str, int]()

    def nth(self, value: Any, number: int, factor: float) -> Any:
        """The value, multiplied at one evaluation."""
        self.count += 1
        if self.count != number + 1:
            return value
        frame = sys._getframe(1)
        given = frame.f_code.co_varnames[: frame.f_code.co_argcount]
        names = {name: one for name, one in frame.f_locals.items() if name not in given}
        self.numbers = {name: int(one) for name, one in names.items() if isinstance(one, int | np.integer)}
        return factor * value

    def words(self) -> str:
        """Description of this evaluation: by these integers, if there are any."""
        where = " and ".join(f"{name} = {value}" for name, value in self.numbers.items())
        return f"at {where or 'one evaluation alone'}"


def at(value: NDArray, index: tuple[int, ...], factor: float) -> NDArray:
    """The array, multiplied at an index."""
    found = np.array(value)
    found[index] *= factor
    return found
