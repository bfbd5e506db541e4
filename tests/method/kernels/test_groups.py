"""Groups of items: compiled code does what the plain functions say, and every number comes to its place."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from endotsr.method.kernels.groups import GROUP, column, keep, keep_where, kept, write_group
from endotsr.method.kernels.jit import jit, jit_formula
from endotsr.method.kernels.vectors import local_array

TWO, THREE = 2 * GROUP, 3 * GROUP
ITEMS = 4 * GROUP
DTYPES = pytest.mark.parametrize("dtype", [np.float32, np.float64])
RANGES = pytest.mark.parametrize("first, stop", [(0, 0), (3, 4), (0, GROUP), (5, 5 + 3 * GROUP), (1, 2 * GROUP)])


def _sums_of(first, stop, values, out):
    """Rows of `out`: the number, its square and its cube; group by group."""
    results = local_array(THREE, values)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            value = values[start + item]
            results[item], results[GROUP + item], results[2 * GROUP + item] = value, value**2, value**3
        write_group(results, start, count, out)


@DTYPES
@RANGES
def test_the_results_of_groups_come_to_their_columns(first, stop, dtype):
    values = np.random.default_rng(4).normal(size=ITEMS).astype(dtype)
    wanted = np.full((3, values.size), 7, dtype)
    for row, power in zip(wanted, (1, 2, 3), strict=True):
        row[first:stop] = values[first:stop] ** power
    for function in (_sums_of, jit(_sums_of)):
        out = np.full((3, values.size), 7, dtype)
        function(first, stop, values, out)
        np.testing.assert_allclose(out, wanted, rtol=1e-6)


@jit_formula
def turn(x, y, shift):
    """A formula: scalars in, a tuple out."""
    return x - y, type(x)(2) * y + shift, x


def _turned(first, stop, points, valid, kept_pairs, out):
    """The driver of `turn`; zeros where not valid. Two numbers of each item also pass through `keep` and `kept`."""
    results, pairs = local_array(THREE, points), local_array(TWO, points)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            i = start + item
            x, y = column(points, 2, i)
            keep(pairs, item, (y, x))
            keep_where(valid[i], results, item, turn(x, y, points[2, i]))
        write_group(results, start, count, out)
        for item in range(count):
            kept_pairs[0, start + item], kept_pairs[1, start + item] = kept(pairs, 2, item)


@DTYPES
@RANGES
@pytest.mark.parametrize("layout", ["rows", "columns", "every second"])
def test_a_formula_is_carried_to_every_item_of_a_range(first, stop, layout, dtype):
    rng = np.random.default_rng(5)
    points, valid = rng.normal(size=(3, ITEMS)).astype(dtype), rng.random(ITEMS) < 0.5
    points[:, ~valid] = np.nan
    given = {"rows": points, "columns": np.asfortranarray(points), "every second": np.repeat(points, 2, axis=1)[:, ::2]}
    x, y, shift = points[:, first:stop]
    wanted = np.where(valid[first:stop], (x - y, 2 * y + shift, x), 0)
    for function in (_turned, jit(_turned)):
        out, pairs = np.full((3, ITEMS), 7, dtype), np.full((2, ITEMS), 7, dtype)
        function(first, stop, given[layout], valid, pairs, out)
        np.testing.assert_array_equal(out[:, first:stop], wanted)
        np.testing.assert_array_equal(pairs[:, first:stop], (y, x))
        for untouched in (out, pairs):
            assert (untouched[:, :first] == 7).all() and (untouched[:, stop:] == 7).all()


def _asked_size(points, size):
    return column(points, size, 0)


def _asked_size_of_kept(points, size):
    return kept(local_array(TWO, points), size, 0)


@pytest.mark.skipif(not hasattr(turn, "py_func"), reason="needs the compiler")
@pytest.mark.parametrize("function", [_asked_size, _asked_size_of_kept])
def test_the_size_of_a_tuple_must_be_a_constant(function):
    with pytest.raises(TypingError):
        jit(function)(np.zeros((2, 3)), 2)
