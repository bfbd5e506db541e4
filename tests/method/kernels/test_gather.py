"""Columns regathered in their own memory equal columns gathered into new memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endotsr.method.kernels.gather import HEADROOM, gather_columns, regather_columns


@given(sizes=st.lists(st.integers(1, 90), min_size=1, max_size=8), seed=st.integers(0, 2**32 - 1))
def test_a_row_of_densifications_in_place_equals_new_arrays(sizes, seed):
    rng = np.random.default_rng(seed)
    expected = found = rng.normal(size=(2, 3, 40)).astype(np.float32)
    for size in sizes:
        survivors = np.sort(rng.choice(expected.shape[-1], min(size, expected.shape[-1]), replace=False))
        fresh = rng.integers(0, expected.shape[-1], size - survivors.size)
        source, kept = np.concatenate([survivors, fresh]).astype(np.intp), survivors.size
        expected, found = gather_columns(expected, source, kept), regather_columns(found, source, kept)
        np.testing.assert_array_equal(found, expected)
        assert found.flags.c_contiguous
        assert found.dtype == expected.dtype


@pytest.mark.parametrize("size", [30, 40, int(HEADROOM * 40)])
def test_memory_is_used_again_while_it_has_room(size):
    first = regather_columns(np.ones((2, 40)), np.arange(40), 40)
    again = regather_columns(first, np.arange(size) % 40, 20)
    assert np.shares_memory(first, again)
    more = regather_columns(again, np.arange(int(HEADROOM * 40) + 1) % size, 20)
    assert not np.shares_memory(again, more)


def test_an_array_of_its_own_and_the_middle_of_another_are_never_written_to():
    for array in (np.ones((3, 4)), np.arange(12.0).reshape(3, 4)[1:]):
        before = array.copy()
        regather_columns(array, np.array([2, 0]), 1)
        np.testing.assert_array_equal(array, before)
