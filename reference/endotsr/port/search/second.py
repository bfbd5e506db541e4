"""Changes of more than one expression, most of them tried if no other explains both passes.

Two entries of a tuple exchanged; two numbers of one line; another order of statements; an expression of the function
that replaces another or is combined with it; a factor at one index of an array, or at one evaluation of an expression.
"""

import ast
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.search.places import Spot, Statement, written

MOST_INDICES = 16  # longest first axis of an array of which every index is tried
MOST_INNER = 4  # longest second axis
LONGEST = 24  # characters of a moved expression
BESIDE = ("({t}) * ({e})", "({t}) / ({e})", "({t}) * (1 - ({e}))", "({t}) + ({e})", "({t}) - ({e})")
BESIDE_TRUE = ("({t}) & ({e})", "({t}) | ({e})", "({t}) & ~({e})")


class SecondChange(NamedTuple):
    """A change of a place, its description, and the context that applies it."""

    spot: Spot
    text: str
    writing: AbstractContextManager


def pairs(spots: Sequence[Spot]) -> Iterator[SecondChange]:
    """Two numbers of one line, both changed."""
    numbers = [s for s in spots if _is_number(s.node) and len(s.holders) == 1]
    for one, other in combinations(numbers, 2):
        if one.node.lineno != other.node.lineno:
            continue
        for first in _values_near(one.node):
            for second in _values_near(other.node):
                text = f"`{first}` where `{ast.unparse(one.node)}` is right, and `{second}` where "
                yield SecondChange(one, f"{text}`{ast.unparse(other.node)}` is", _both(one, first, other, second))


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
def _both(one: Spot, first: str, other: Spot, second: str) -> Iterator[None]:
    with ExitStack() as stack:
        stack.enter_context(written(one, first))
        stack.enter_context(written(other, second))
        yield


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
    patterns = BESIDE_TRUE if spot.truth else () if inside or not any(map(_is_real, values)) else BESIDE
    text = ast.unparse(spot.node)
    for other in others:
        if other != text:
            yield other, 0
            yield from ((pattern.format(t=text, e=other), 1) for pattern in patterns)


def _is_real(value: Any) -> bool:
    return np.asarray(value).dtype.kind == "f"


def parts(spot: Spot, values: Sequence[Any]) -> Iterator[tuple[str, str]]:
    """Texts with a factor `_knob` at one index or one evaluation of a real expression, and their description."""
    if isinstance(spot.node, ast.stmt) or len(spot.holders) > 1 or not all(map(_is_real, values)):
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
