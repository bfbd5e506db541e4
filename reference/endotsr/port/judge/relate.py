"""Relations between a wrong array and the expected one, found without a list of mistakes.

In: an output of a port, the expected array, the tolerance, and the other arrays of the case. Out: the relations that
are satisfied to some tolerances, the most specific kinds first: a factor, a permutation, a sign, a clamp, indices of an
axis, a constant, a matrix, a factor or a difference that is an array of the case, a region. Each is a fact about the
two arrays, not necessarily the cause. Of an output that is not finite, this alone is said.
"""

import math
from collections.abc import Iterator, Mapping

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.port.judge.compare import scale_of

FITS = 4.0  # largest residual of a relation, in tolerances, times the magnitude of its factor above 1
DIFFERS = 3.0  # smallest difference, in multiples of FITS; below it, relations are indistinguishable from rounding
SMALLEST_BOARD = 4  # smallest number of rows and columns for a significant alternation
CLOSE_TO_ONE = 1e-3  # smaller differences of a factor from 1 are printed as such
FEWEST_ROUNDED = 8  # entries from which the size of rounding errors is told
SPREAD = 64.0  # largest ratio of the quartiles of rounding errors; it is 3 for errors that are spread evenly
MOST_INDICES = 8  # indices of an axis that are listed
LARGEST_PERMUTED = 16  # longest axis that is searched for a permutation
KNOWN = {
    "2": 2.0, "3": 3.0, "4": 4.0, "5": 5.0, "6": 6.0, "9": 9.0, "1/2": 0.5, "1/3": 1 / 3, "1/4": 0.25, "1/5": 0.2,
    "1/6": 1 / 6, "1/9": 1 / 9, "Y00": 0.28209479177387814, "1/Y00": 1 / 0.28209479177387814, "pi": math.pi,
    "2 pi": 2 * math.pi, "1/(2 pi)": 1 / (2 * math.pi), "1/pi": 1 / math.pi, "255": 255.0, "1/255": 1 / 255,
    "ln 2": math.log(2), "1/1.1": 1 / 1.1,
}  # fmt: skip
"""Constants of the method, by the name used for a factor."""


class Relation(msgspec.Struct, frozen=True, kw_only=True):
    """A relation between a wrong output and the expected one."""

    kind: str
    """the search that found it: times, zero, transposed, order, sign, matrix, clamp, axis, plus, equals, difference,
    factor, where, nan, entries"""
    text: str
    value: float | None = None
    index: tuple[int, ...] = ()


class OutputPair:
    """A wrong output and the expected one."""

    def __init__(self, got: NDArray, expected: NDArray, kind: str, tolerance: float) -> None:
        self.got, self.expected = (a.astype(np.float64) for a in (got, expected))
        unit = tolerance * scale_of(expected, kind or "max") if tolerance else 0.0
        self.unit = np.broadcast_to(np.asarray(unit, np.float64), self.got.shape)
        with np.errstate(invalid="ignore"):
            self.wrong = ~(np.abs(self.got - self.expected) <= self.unit)

    def close(self, other: NDArray, factor: float = 1.0) -> bool:
        """Whether the port's array equals this one, to some tolerances."""
        with np.errstate(all="ignore"):
            return bool((np.abs(self.got - other) <= FITS * self.unit * max(1.0, abs(factor))).all())

    @property
    def telling(self) -> bool:
        """Whether the difference is large enough for relations."""
        with np.errstate(all="ignore"):
            return bool((np.abs(self.got - self.expected) > DIFFERS * FITS * self.unit).any())

    def part(self, axis: int, index: int) -> "OutputPair":
        """One index of an axis."""
        found = object.__new__(OutputPair)
        for name in ("got", "expected", "unit", "wrong"):
            setattr(found, name, np.take(getattr(self, name), index, axis))
        return found


def relations(
    got: NDArray, expected: NDArray, kind: str, tolerance: float, others: Mapping[str, NDArray]
) -> list[Relation]:
    """The relations between two arrays of the same shape, the most specific kinds first.

    kind, tolerance   as of the rule of the output
    others            the other arrays of the case: inputs, and the expected other outputs
    """
    with np.errstate(all="ignore"):  # outputs up to 1e308: a product or a mean may overflow, and then fits nothing
        return _relations(OutputPair(got, expected, kind, tolerance), others)


def _relations(pair: OutputPair, others: Mapping[str, NDArray]) -> list[Relation]:
    if not pair.wrong.any():
        return []
    broken = ~np.isfinite(pair.got)
    if broken.any():
        return [Relation(kind="nan", text=f"{_part_of(broken)} not finite")]
    if not pair.telling:
        return [Relation(kind="entries", text="the difference is of the size of rounding")]
    search = (
        _times,
        _orders,
        _signs,
        _clamps,
        _axes,
        _plus,
        _offsets,
        _matrices,
        _arrays,
        _regions,
        _parities,
        _entries,
    )
    return [relation for one in search for relation in one(pair, others)]


def number_text(value: float) -> str:
    """A factor as text: its name if it is a constant of the method."""
    for name, known in KNOWN.items():
        for sign, text in ((1, name), (-1, f"-{name}")):
            if math.isclose(value, sign * known, rel_tol=2e-5):
                return text
    return f"{value:.6g}"


def factor_text(factor: float) -> str:
    """A factor as text; of one close to 1, the difference from 1, which shows a constant of few digits."""
    off = factor - 1.0
    if not 0 < abs(off) < CLOSE_TO_ONE:
        return number_text(factor)
    size = " (a constant rounded to float32 differs by up to 6e-8)" if abs(off) < 2.0**-24 else ""
    return f"1 {'+' if off > 0 else '-'} {abs(off):.2g}{size}"


def _times(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    square = float((pair.expected**2).sum())
    if not square:
        return
    factor = float((pair.got * pair.expected).sum()) / square
    if not math.isfinite(factor):
        return
    if not pair.got.any():
        yield Relation(kind="zero", text="0 everywhere", value=0.0)
    elif pair.close(factor * pair.expected, factor):
        text = "has the opposite sign" if math.isclose(factor, -1.0, rel_tol=1e-5) else f"times {factor_text(factor)}"
        yield Relation(kind="times", text=text, value=factor)


def _orders(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    shape = pair.got.shape
    if len(shape) >= 2 and shape[0] == shape[1] and pair.close(pair.expected.swapaxes(0, 1)):
        yield Relation(kind="transposed", text="transposed")
        return
    for axis, size in enumerate(shape):
        order = _order_of(pair, axis) if 1 < size <= LARGEST_PERMUTED else None
        if order is not None:
            text = f"axis {axis} has the expected entries in the order {list(order)}"
            yield Relation(kind="order", text=text, index=order)
    for axis in range(len(shape) - 1):
        if 1 < shape[axis] != shape[axis + 1] > 1:
            turned = np.ascontiguousarray(pair.expected.swapaxes(axis, axis + 1)).reshape(shape)
            if pair.close(turned):
                text = f"written with axes {axis} and {axis + 1} in the other order of memory"
                yield Relation(kind="transposed", text=text, index=(axis, axis + 1))


def _order_of(pair: OutputPair, axis: int) -> tuple[int, ...] | None:
    """Index of the expected slice at each index of an axis; None if this is no permutation, or the identity."""
    rows = [np.moveaxis(a, axis, 0).reshape(a.shape[axis], -1) for a in (pair.got, pair.expected, pair.unit)]
    near = np.abs(rows[0][:, None] - rows[1][None]) <= FITS * (rows[2][:, None] + rows[2][None])
    fits = np.asarray(near.all(axis=-1))
    order, free = [], set(range(len(fits)))
    for k, row in enumerate(fits):
        possible = [j for j in np.flatnonzero(row) if j in free]
        if not possible:
            return None
        order.append(int(k if k in possible else possible[0]))
        free.discard(order[-1])
    return None if order == sorted(order) else tuple(order)


def _signs(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    with np.errstate(all="ignore"):
        alike = bool((np.abs(np.abs(pair.got) - np.abs(pair.expected)) <= FITS * pair.unit).all())
    if alike:
        yield Relation(kind="sign", text=f"{_part_of(pair.wrong)} {_have(pair.wrong)} the opposite sign")


def _matrices(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """A 3 x 3 matrix between the two, possibly a rotation of the pose."""
    if pair.got.shape[:1] != (3,):
        return
    got, expected = pair.got.reshape(3, -1), pair.expected.reshape(3, -1)
    named = {}
    for name in ("rotation_matrix",):
        w = others.get(name)
        if w is not None and w.shape == (3, 3) and not np.allclose(w, np.eye(3)):
            named = {"W (W where W^T is right)": w @ w, "W^T (W^T where W is right)": w.T @ w.T, "W": w, "W^T": w.T}
    for text, matrix in named.items():
        if pair.close((matrix @ expected).reshape(pair.got.shape), 2.0):
            yield Relation(kind="matrix", text=f"multiplied by {text}")
            return
    if expected.shape[1] >= 5 and np.linalg.matrix_rank(expected) == 3:
        matrix = got @ np.linalg.pinv(expected)
        if (
            pair.close((matrix @ expected).reshape(pair.got.shape), 2.0)
            and abs(matrix - matrix[0, 0] * np.eye(3)).max()
        ):
            yield Relation(kind="matrix", text=f"multiplied by the matrix {np.round(matrix, 3).tolist()}")


def _clamps(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """Equal up to a bound that only one of the two respects."""
    if pair.got.size < 2 or pair.wrong.all():
        return
    for one, other, text in ((pair.got, pair.expected, "clamped"), (pair.expected, pair.got, "not clamped")):
        bound = float(one[pair.wrong][0])
        if not (np.abs(one[pair.wrong] - bound) <= FITS * pair.unit[pair.wrong]).all() or not pair.wrong.sum() > 1:
            continue
        beyond = other[pair.wrong] - bound
        side = "above" if (beyond > 0).all() else "below" if (beyond < 0).all() else ""
        inside = (one <= bound + pair.unit).all() if side == "above" else (one >= bound - pair.unit).all()
        if side and inside:
            yield Relation(kind="clamp", text=f"{text} {side} {number_text(bound) if bound else '0'}", value=bound)


def _axes(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """Wrong only at some indices of an axis, with the relation there."""
    for axis, size in enumerate(pair.got.shape):
        if pair.got.ndim == 1 and size > LARGEST_PERMUTED:
            continue
        bad = np.flatnonzero(np.moveaxis(pair.wrong, axis, 0).reshape(size, -1).any(axis=1))
        if not 0 < len(bad) < size:
            continue
        inner = [_inside(pair.part(axis, int(k))) for k in bad]
        same = inner[0] if all(i == inner[0] for i in inner) else ""
        where = f"only at {_indices(bad, size, others)} of axis {axis}" + (f", there {same}" if same else "")
        yield Relation(kind="axis", text=where, index=(axis, *(int(k) for k in bad)))


def _indices(bad: NDArray, size: int, others: Mapping[str, NDArray]) -> str:
    """Indices of an axis: every visible Gaussian, or a list, or their number if there are many."""
    visible = others.get("visible")
    if visible is not None and visible.shape == (size,) and np.array_equal(np.flatnonzero(visible), bad):
        return "every visible Gaussian"
    return f"{[int(k) for k in bad]}" if len(bad) <= MOST_INDICES else f"{len(bad)} of {size} indices"


def _inside(pair: OutputPair) -> str:
    if pair.got.size < 2:
        return ""
    for one in (_times, _orders, _signs, _plus):
        for relation in one(pair, {}):
            return relation.text
    return ""


def _plus(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """An added constant, for all entries or per index of the first axis."""
    off = pair.got - pair.expected
    if off.size < 2:
        return
    if pair.close(pair.expected + off.mean()):
        yield Relation(kind="plus", text=f"plus {off.mean():.6g}", value=float(off.mean()))
    elif off.ndim > 1 and off.shape[0] <= LARGEST_PERMUTED:
        along = off.reshape(len(off), -1).mean(axis=1)
        added = along.reshape(-1, *[1] * (off.ndim - 1))
        if off[0].size > 1 and pair.close(pair.expected + added):
            shown = ", ".join(f"{a:.4g}" for a in along)
            yield Relation(kind="plus", text=f"plus ({shown}) along axis 0", value=float(along[0]))


def _offsets(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """A constant added where entries are wrong, one for each row of axis 0; others, such as hidden ones, are right."""
    if pair.got.ndim < 2 or pair.wrong.all() or len(pair.got) > LARGEST_PERMUTED:
        return
    off, rows = pair.got - pair.expected, []
    for row, wrong, unit in zip(off, pair.wrong, pair.unit):
        if not wrong.any():
            rows.append(0.0)
            continue
        value = float(np.median(row[wrong]))
        if wrong.sum() < 2 or not (np.abs(row[wrong] - value) <= FITS * unit[wrong]).all():
            return
        rows.append(value)
    if pair.wrong.any():
        each = f"({', '.join(f'{a:.4g}' for a in rows)}) along axis 0"
        text = f"plus {rows[0]:.6g}" if len(set(rows)) == 1 else f"plus {each}"
        yield Relation(kind="plus", text=f"{text}, where it is wrong", value=rows[0])


TRANSFORMS = {
    "{}": lambda x: x, "1 / {}": lambda x: 1 / x, "{}^2": lambda x: x * x, "1 / {}^2": lambda x: 1 / (x * x),
    "exp({})": np.exp, "exp(-{})": lambda x: np.exp(-x), "1 / (1 - sigmoid({}))": lambda x: 1 + np.exp(x),
    "sigmoid({})": lambda x: 1 / (1 + np.exp(-x)), "1 / sigmoid({})": lambda x: 1 + np.exp(-x),
    "1 / (o (1 - o)), o = sigmoid({})": lambda x: (1 + np.exp(x)) * (1 + np.exp(-x)),
    "|{}|": lambda x: np.sqrt((x * x).sum(axis=0)) if x.ndim > 1 else np.abs(x),
    "1 / |{}|": lambda x: 1 / (np.sqrt((x * x).sum(axis=0)) if x.ndim > 1 else np.abs(x)),
}  # fmt: skip


def _arrays(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """Another array of the case replaces the output, multiplies it, or is added to it."""
    if pair.got.size < 2:
        return
    off = pair.got - pair.expected
    for name, array in others.items():
        if array.dtype.kind != "f" or not array.size:
            continue
        with np.errstate(all="ignore"):
            if array.shape == pair.got.shape and np.isfinite(array).all():
                if array.any() and pair.close(array):
                    yield Relation(kind="equals", text=f"equal to {name}")
                square = float((array**2).sum())
                part = float((off * array).sum()) / square if square else 0.0
                if part and pair.close(pair.expected + part * array):
                    yield Relation(kind="difference", text=f"plus {number_text(part)} times {name}", value=part)
            for text, transform in TRANSFORMS.items():
                factor = transform(array)
                if _fits_shape(factor, pair) and pair.close(pair.expected * factor, float(np.abs(factor).max())):
                    yield Relation(kind="factor", text=f"times {text.format(name)}")
                    break


def _fits_shape(factor: NDArray, pair: OutputPair) -> bool:
    shape = pair.got.shape
    return bool(factor.size > 1 and factor.shape == shape[len(shape) - factor.ndim :] and np.isfinite(factor).all())


def _regions(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """Wrong only at excluded pixels, only at some pixels of the tissue, or only near the border."""
    if pair.got.ndim < 2:
        return
    wrong = np.asarray(pair.wrong.reshape(-1, *pair.wrong.shape[-2:]).any(axis=0))
    mask = others.get("mask")
    if mask is not None and mask.shape == wrong.shape and mask.any() and not mask.all():
        if not (wrong & mask).any():
            yield Relation(kind="where", text="only at excluded pixels", value=0.0)
        elif not (wrong & ~mask).any() and wrong.sum() < mask.sum():
            yield Relation(kind="where", text="only at some pixels of the tissue", value=1.0)
    height, width = int(wrong.shape[0]), int(wrong.shape[1])
    for rim in (1, 2, 3, 5):
        if 4 * rim < min(height, width) and not wrong[rim : height - rim, rim : width - rim].any():
            yield Relation(kind="where", text=f"only within {rim} pixels of the border", value=float(rim + 1))
            return


def _parities(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    """Wrong only on every second row or column, or on one colour of a chessboard, and at more than half of them."""
    if pair.got.ndim < 2 or min(pair.wrong.shape[-2:]) < SMALLEST_BOARD:
        return
    wrong = np.asarray(pair.wrong.reshape(-1, *pair.wrong.shape[-2:]).any(axis=0))
    row, column = np.indices(wrong.shape) % 2
    boards = {"odd rows": row, "even rows": 1 - row, "odd columns": column, "even columns": 1 - column,
              "pixels whose row and column are one even and one odd": row ^ column,
              "pixels whose row and column are both even or both odd": 1 - (row ^ column)}  # fmt: skip
    for text, board in boards.items():
        if not wrong[board == 0].any() and 2 * wrong.sum() > board.sum():
            yield Relation(kind="where", text=f"only at {text}, counted from 0", value=2.0)


ROUNDED = {"single precision (2^-24)": 2.0**-24, "half precision (2^-11)": 2.0**-11}


def _rounded(pair: OutputPair) -> str:
    """The precision whose rounding errors the relative errors look like: of both signs, and of about one size."""
    where = pair.wrong & (pair.expected != 0)
    if where.sum() < FEWEST_ROUNDED:
        return ""
    off = (pair.got[where] - pair.expected[where]) / np.abs(pair.expected[where])
    small, typical, large = (float(q) for q in np.quantile(np.abs(off), (0.25, 0.5, 0.75)))
    if large > SPREAD * small:
        return ""
    mixed = 4 * min((off > 0).sum(), (off < 0).sum()) > len(off) / 2
    for name, unit in ROUNDED.items():
        if mixed and unit / 16 < typical < 4 * unit:
            return f"; the relative errors, typically {typical:.1g}, are of the size of rounding to {name}"
    return ""


def _entries(pair: OutputPair, others: Mapping[str, NDArray]) -> Iterator[Relation]:
    text = f"{_part_of(pair.wrong)} {_have(pair.wrong)} another value{_rounded(pair)}"
    yield Relation(kind="entries", text=text)


def _part_of(where: NDArray) -> str:
    count = int(where.sum())
    return "every entry" if count == where.size else f"{count} of {where.size} entries"


def _have(where: NDArray) -> str:
    return "has" if where.all() or where.sum() == 1 else "have"
