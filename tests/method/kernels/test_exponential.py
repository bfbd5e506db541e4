"""2^x of the kernels, for x <= 0."""

import numpy as np
import pytest

from endotsr.method.kernels.exponential import exp2_nonpositive
from endotsr.method.kernels.jit import jit


def _each(x, out):
    for i in range(x.size):
        out[i] = exp2_nonpositive(x[i])


each = jit(_each)


def exp2(x):
    out = np.empty_like(x)
    each(x, out)
    return out


@pytest.mark.parametrize("dtype, lowest, bound", [(np.float32, -126, 3e-7), (np.float64, -1022, 1e-15)])
def test_exact_at_whole_numbers_and_close_between_them(dtype, lowest, bound):
    whole = np.arange(lowest, 1).astype(dtype)
    np.testing.assert_array_equal(exp2(whole), np.exp2(whole))
    between = np.random.default_rng(1).uniform(lowest, 0, 4000).astype(dtype)
    np.testing.assert_allclose(exp2(between), np.exp2(between.astype(np.float64)), rtol=bound)


@pytest.mark.parametrize("dtype, lowest", [(np.float32, -126), (np.float64, -1022)])
def test_below_the_smallest_normal_number_nothing_gets_smaller(dtype, lowest):
    below = np.array([lowest, lowest - 0.5, lowest - 1, 2 * lowest, -np.inf], dtype)
    np.testing.assert_array_equal(exp2(below), np.full(5, np.finfo(dtype).smallest_normal, dtype))
