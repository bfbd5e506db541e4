"""Sums over columns: in blocks of a given length, each in the order of its columns, whatever the number of threads."""

import numba
import numpy as np
import pytest

from endotsr.method.kernels.sums import sum_columns
from endotsr.method.kernels.threads import use_threads


def in_order(rows, length):
    """Sums of the blocks, one after another, in the precision of the rows: (blocks, K)."""
    blocks = []
    for first in range(0, rows.shape[1], length):
        total = np.zeros(len(rows), rows.dtype)
        for column in rows[:, first : first + length].T:
            total = total + column
        blocks.append(total)
    return np.array(blocks, rows.dtype).reshape(-1, len(rows))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("count", [0, 1, 6, 7, 8, 40, 41])
def test_blocks_are_summed_in_the_order_of_their_columns(dtype, count):
    """Bit for bit: columns of very different size, so that another order gives another sum."""
    rng = np.random.default_rng(count)
    rows = (rng.standard_normal((3, count)) * 10.0 ** rng.integers(-6, 6, (3, count))).astype(dtype)
    found = sum_columns(rows, 7)
    assert found.dtype == dtype
    assert np.array_equal(found, in_order(rows, 7).sum(axis=0))


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_change_no_bit(threads):
    before = numba.get_num_threads()
    rows = np.random.default_rng(0).standard_normal((4, 999)).astype(np.float32)
    expected = in_order(rows, 64).sum(axis=0)
    try:
        use_threads(threads)
        assert np.array_equal(sum_columns(rows, 64), expected)
    finally:
        use_threads(before)
