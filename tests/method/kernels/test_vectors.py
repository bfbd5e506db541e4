"""Local arrays of kernels: compiled code does what the plain functions say."""

import numba
import numpy as np
import pytest
from numba.core.errors import TypingError

from endotsr.method.kernels.jit import jit, jit_inline
from endotsr.method.kernels.vectors import fold, lanes, local_array, lowest_bit, prefetch, vector

ROOM = 24
DTYPES = pytest.mark.parametrize("dtype", [np.float32, np.float64])


def _add_columns(sums, row):
    for k in range(lanes(row)):
        sums[0][k] += row[k]
        sums[1][k] += row[k] * row[k]


_add_columns_kernel = jit_inline(_add_columns)


def _moments(table):
    """Lane by lane sums of the rows and of their squares, folded; a third vector shows that none shares its place."""
    sums, marks = (vector(table), vector(table)), vector(table)
    for k in range(lanes(table)):
        sums[0][k], sums[1][k], marks[k] = 0, 0, k
    for i in range(table.shape[0]):
        prefetch(table, min(i + 3, table.shape[0] - 1))
        _add_columns_kernel(sums, table[i])
    return fold(sums[0]), fold(sums[1]), fold(marks)


def _backwards(values):
    """Through a local array that is filled anew in every pass of a loop."""
    total = values.dtype.type(0)
    for i in range(values.size - ROOM):
        kept = local_array(ROOM, values)
        for k in range(ROOM):
            kept[k] = values[i + k]
        for k in range(ROOM):
            total = total / 2 + kept[ROOM - 1 - k]
    return total


def _asked_size(values, size):
    return local_array(size, values)[0]


def _only_lanes(values):
    return lanes(values)


@DTYPES
def test_compiled_vectors_compute_what_the_plain_functions_do(dtype):
    count = lanes(np.empty(3, dtype))
    assert count == jit(_only_lanes)(np.empty(3, dtype)) and count in (8, 64 // dtype().itemsize)
    table = np.random.default_rng(0).normal(size=(7, count)).astype(dtype)
    compiled = jit(_moments)(table)
    assert compiled == pytest.approx(_moments(table), rel=1e-5)
    np.testing.assert_allclose(compiled, [table.sum(), (table**2).sum(), count * (count - 1) / 2], rtol=1e-5)


@DTYPES
def test_fold_adds_the_upper_half_to_the_lower(dtype):
    rng, count = np.random.default_rng(1), lanes(np.empty(0, dtype))
    values = (rng.normal(size=count) * 10 ** rng.uniform(0, 6, count)).astype(dtype)
    opposite = np.ones(count, dtype)
    opposite[0], opposite[count // 2] = 1e20, -1e20  # cancel in the first step; in another order they drown the ones
    expected = values
    while expected.size > 1:
        expected = np.array([expected[k] + expected[k + expected.size // 2] for k in range(expected.size // 2)], dtype)

    def folded(given):
        own = vector(given)
        for k in range(lanes(given)):
            own[k] = given[k]
        return fold(own)

    assert fold(values) == expected[0] == jit(folded)(values)
    assert fold(opposite) == jit(folded)(opposite) == count - 2


@DTYPES
def test_a_local_array_in_a_loop(dtype):
    values = np.random.default_rng(2).normal(size=40).astype(dtype)
    assert _backwards(values) == pytest.approx(jit(_backwards)(values), rel=1e-6)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs the compiler")
def test_the_size_of_a_local_array_must_be_a_constant():
    with pytest.raises(TypingError, match="local_array"):
        jit(_asked_size)(np.zeros(3), 5)


def _numbers_of(bits, out):
    count = 0
    while bits != np.uint64(0):
        out[count] = lowest_bit(bits)
        bits &= bits - np.uint64(1)
        count += 1
    return count


@pytest.mark.parametrize("numbers", [[], [0], [63], [0, 63], [1, 2, 31, 32, 33, 62], list(range(64))])
def test_the_lowest_bit_again_and_again_gives_all_of_them(numbers):
    bits, out = np.uint64(sum(1 << k for k in numbers)), np.zeros(64, np.int64)
    assert list(out[: _numbers_of(bits, out)]) == list(out[: jit(_numbers_of)(bits, out)]) == numbers
