"""Misread requests: a setting fixed by a port, an input in another order, unit or sign."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations, permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.format import Case
from endotsr.port.operations.operation import Inputs, Outputs, Settings

MOST_ORDERED = 4  # longest axis with every order tried
MOST_SWAPPED = 16  # longest axis with the exchange of every pair tried
# How a port may misread a number or a switch.
NUMBER_RULES: dict[str, Callable[[Any], Any]] = {
    "twice": lambda v: 2 * v, "half": lambda v: v / 2, "the square of": lambda v: v * v,
    "10 times": lambda v: 10 * v, "1/10 of": lambda v: v / 10, "255/256 of": lambda v: v * 255 / 256,
    "1 more than": lambda v: v + 1, "1 less than": lambda v: v - 1, "minus": lambda v: -v,
}  # fmt: skip
SWITCH_RULES: dict[str, Callable[[Any], Any]] = {"the opposite of": lambda v: not v}


class OtherReading(NamedTuple):
    """A misreading of requests, the same for all cases."""

    text: str
    rank: tuple[int, int]  # as of the other changes
    ask: Callable[[Inputs, Settings], tuple[Inputs, Settings]]
    tell: Callable[[Outputs], Outputs] = lambda found: found
    at: "Callable[[float], OtherReading] | None" = None  # the same with another number
    rest: float = 0.0  # the number of the first case
    of: str = ""  # the setting or input
    number: bool = False  # of a number: other numbers may give the same decisions


def other_requests(cases: Sequence[Case], all_cases: Sequence[Case]) -> Iterator[OtherReading]:
    """Misreadings of the requests of one operation, settings first, those in no section before others.

    Inputs are those of the first case.
    """
    for path in sorted(dict.fromkeys(path for case in cases for path in leaves(case.settings)), key=len):
        yield from (one._replace(of=".".join(path)) for one in _settings(path, cases, all_cases))
    for name, array in cases[0].inputs.items():
        yield from (one._replace(of=name) for one in _inputs(name, array.shape, array.dtype))


def exchanges(cases: Sequence[Case]) -> Iterator[OtherReading]:
    """Two settings of one section, or two inputs of one shape, each read for the other; or one setting for another."""
    paths = list(dict.fromkeys(path for case in cases for path in leaves(case.settings)))
    for one, other in combinations(paths, 2):
        pairs = [[value_at(case.settings, path) for path in (one, other)] for case in cases]
        if one[:-1] == other[:-1] and all(map(_are_numbers, pairs)) and any(first != second for first, second in pairs):
            yield OtherReading(f"{'.'.join(one)} and {'.'.join(other)} exchanged", (0, 1), partial(_turned, one, other))
            for path, read in ((one, other), (other, one)):
                text = f"{'.'.join(read)} in place of {'.'.join(path)}"
                yield OtherReading(text, (0, 0), partial(_copied, path, read), number=True)
    for (a, first), (b, second) in combinations(cases[0].inputs.items(), 2):
        if (first.shape, first.dtype) == (second.shape, second.dtype):
            tell = partial(_turned_outputs, f"d_{a}", f"d_{b}")
            yield OtherReading(f"the inputs {a} and {b} exchanged", (2, 1), partial(_turned_inputs, a, b), tell)


def _are_numbers(pair: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in pair)


def _turned(
    one: tuple[str, ...], other: tuple[str, ...], inputs: Inputs, settings: Settings
) -> tuple[Inputs, Settings]:
    """The request with two settings exchanged."""
    first, second = value_at(settings, one), value_at(settings, other)
    return inputs, with_value(with_value(settings, one, second), other, first)


def _copied(path: Sequence[str], read: Sequence[str], inputs: Inputs, settings: Settings) -> tuple[Inputs, Settings]:
    """The request with the value of one setting in the place of another."""
    return inputs, with_value(settings, path, value_at(settings, read))


def _turned_inputs(one: str, other: str, inputs: Inputs, settings: Settings) -> tuple[Inputs, Settings]:
    """The request with two inputs exchanged."""
    return {**inputs, one: inputs[other], other: inputs[one]}, settings


def _turned_outputs(one: str, other: str, found: Outputs) -> Outputs:
    """The outputs with two gradients exchanged, if both exist."""
    return {**found, one: found[other], other: found[one]} if {one, other} <= found.keys() else found


def leaves(settings: Mapping[str, Any], above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The path of every value."""
    for key, value in settings.items():
        if isinstance(value, Mapping):
            yield from leaves(value, (*above, key))
        else:
            yield (*above, key)


def value_at(settings: Any, path: Sequence[str]) -> Any:
    """The value of a path; None if missing."""
    for key in path:
        settings = settings.get(key) if isinstance(settings, Mapping) else None
    return settings


def with_value(settings: Settings, path: Sequence[str], value: Any) -> Settings:
    """The settings with another value at a path."""
    if len(path) == 1:
        return {**settings, path[0]: value}
    return {**settings, path[0]: with_value(settings[path[0]], path[1:], value)}


def _settings(path: tuple[str, ...], cases: Sequence[Case], all_cases: Sequence[Case]) -> Iterator[OtherReading]:
    """A setting fixed at a value that it has in some case, at 0 or 1, or changed by a rule; no list is fixed."""
    seen = [value_at(case.settings, path) for case in cases]
    seen += [value_at(case.settings, p) for case in all_cases for p in leaves(case.settings) if p[-1] == path[-1]]
    numbers = any(isinstance(v, int | float) and not isinstance(v, bool) for v in seen)
    switches = any(isinstance(v, bool) for v in seen)
    fixed = [*seen, *([0, 1] if numbers else []), *([True, False] if switches else [])]
    yield from (_fixed_at(path, value) for value in dict.fromkeys(v for v in fixed if _can_be_fixed(v)))
    if isinstance(seen[0], float):
        yield _fixed_at(path, seen[0])._replace(at=partial(_fixed_at, path), rest=seen[0])
    name = ".".join(path)
    for rule, change in (NUMBER_RULES if numbers else SWITCH_RULES if switches else {}).items():
        text = f"{rule} {name} in place of {name}"
        yield OtherReading(text, (0, 1), partial(_changed, path, change), number=numbers)


def _can_be_fixed(value: Any) -> bool:
    return value is not None and not isinstance(value, list)


def _fixed_at(path: tuple[str, ...], value: Any) -> OtherReading:
    """The setting with this value wherever a request has it."""

    def ask(inputs: Inputs, settings: Settings) -> tuple[Inputs, Settings]:
        return inputs, with_value(settings, path, value) if _has(settings, path) else settings

    number = isinstance(value, int | float) and not isinstance(value, bool)
    return OtherReading(f"{'.'.join(path)} fixed at {value!r}", (0, 0), ask, number=number)


def _changed(
    path: tuple[str, ...], change: Callable[[Any], Any], inputs: Inputs, settings: Settings
) -> tuple[Inputs, Settings]:
    """The request with its setting changed by a rule."""
    return inputs, with_value(settings, path, change(value_at(settings, path)))


def _has(settings: Settings, path: Sequence[str]) -> bool:
    return value_at(settings, path) is not None


def _inputs(name: str, shape: tuple[int, ...], kind: str) -> Iterator[OtherReading]:
    """An input and its gradient, or a cotangent, in another order; another sign, of all or at one index; another unit.

    The sign of one index is that of axes with another handedness.
    """
    for axis, size in enumerate(shape):
        if 1 < size <= MOST_ORDERED:
            yield from (_ordered(name, axis, np.array(order)) for order in list(permutations(range(size)))[1:])
        elif size > 1:
            if size <= MOST_SWAPPED:
                pairs = [(a, b) for b in range(size) for a in range(b)]
                yield from (_ordered(name, axis, _swapped(size, *pair), f"with {pair} exchanged") for pair in pairs)
            halves = np.arange(size).reshape(2, -1) if size % 2 == 0 else np.arange(size)[None]
            orders = {"backwards": np.arange(size)[::-1], "with its halves interleaved": halves.T.reshape(-1)}
            orders["with its even entries before its odd ones"] = np.argsort(orders["with its halves interleaved"])
            for text, order in orders.items():
                if list(order) != sorted(order):
                    yield _ordered(name, axis, order, text)
    if len(shape) > 1 and len(set(shape[:2])) == 1:
        yield _mapped(name, "transposed", lambda a: a.swapaxes(0, 1), lambda a: a.swapaxes(0, 1))
    for axis in range(len(shape) - 1):
        if 1 < shape[axis] != shape[axis + 1] > 1:
            text, change = f"read with its axes {axis} and {axis + 1} in the other order of memory", _stored(axis)
            yield _mapped(name, text, change, change)
            yield _mapped(name, text, change, lambda a: a)
    if kind == "boolean":
        yield _mapped(name, "negated", lambda a: ~a, lambda a: a)
    if kind == "real":
        for text, factor in (("-1", -1.0), ("2", 2.0), ("1/2", 0.5), ("255", 255.0), ("1/255", 1 / 255),
                             ("pi/180", np.pi / 180)):  # fmt: skip
            yield _mapped(name, f"times {text}", lambda a, f=factor: a * f, lambda a, f=factor: a * f, (2, 1))
        for axis, size in enumerate(shape):
            for k in range(size if 1 < size <= MOST_ORDERED else 0):
                flip = partial(_flipped, axis, k)
                yield _mapped(name, f"with the other sign at {k} of axis {axis}", flip, flip, (2, 1))
        yield _mapped(name, "taken as 0", lambda a: 0 * a, lambda a: 0 * a, (2, 1))


def _stored(axis: int) -> Callable[[NDArray], NDArray]:
    """An array as a program reads it that expects two neighbouring axes in the other order."""

    def change(array: NDArray) -> NDArray:
        shape = list(array.shape)
        shape[axis : axis + 2] = shape[axis + 1], shape[axis]
        return np.ascontiguousarray(array).reshape(shape).swapaxes(axis, axis + 1)

    return change


def _flipped(axis: int, index: int, array: NDArray) -> NDArray:
    """The array with the other sign at one index of an axis."""
    signs = np.ones(array.shape[axis])
    signs[index] = -1
    return array * signs.reshape(-1, *[1] * (array.ndim - 1 - axis))


def _swapped(size: int, a: int, b: int) -> NDArray:
    order = np.arange(size)
    order[[a, b]] = b, a
    return order


def _ordered(name: str, axis: int, order: NDArray, text: str = "") -> OtherReading:
    """One axis in another order."""
    text = text or f"in the order {order.tolist()}"
    return _mapped(
        name, f"read {text} along axis {axis}", lambda a: np.take(a, order, axis),
        lambda a: np.take(a, np.argsort(order), axis),
    )  # fmt: skip


def _mapped(
    name: str, text: str, change: Callable[[NDArray], NDArray], back: Callable[[NDArray], NDArray],
    rank: tuple[int, int] = (0, 2),
) -> OtherReading:  # fmt: skip
    """An input changed, and its gradient changed back; for a cotangent, its output."""
    partner = name.removeprefix("d_") if name.startswith("d_") else f"d_{name}"

    def ask(inputs: Inputs, settings: Settings) -> tuple[Inputs, Settings]:
        return ({**inputs, name: change(inputs[name])} if name in inputs else inputs), settings

    def tell(found: Outputs) -> Outputs:
        return {**found, partner: back(found[partner])} if partner in found else found

    what = f"the output {partner} and its derivative" if name.startswith("d_") else f"the input {name}"
    return OtherReading(f"{what} {text}", rank, ask, tell)
