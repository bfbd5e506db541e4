"""Exponential and logarithm of float32: near the oracle everywhere, and bit by bit those of the C library of Linux."""

import ctypes
import ctypes.util
import re
import sys

import numpy as np
import pytest

from endotsr.method.kernels.elementary import exponential, logarithm
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.kernel_cache import kernel_sources

BITS = {"expf": ((0x00000000, 0x42CFF000), (0x80000000, 0xC2CFF000)), "logf": ((0x00800000, 0x7F800000),)}
STEP = 4801  # between tested numbers, in units of the last place
OWN = {"expf": exponential, "logf": logarithm}
ORACLE = {"expf": np.exp, "logf": np.log}


def _exponentials(x, out):
    for i in range(x.size):
        out[i] = exponential(x[i])


def _logarithms(x, out):
    for i in range(x.size):
        out[i] = logarithm(x[i])


KERNELS = {"expf": jit(_exponentials), "logf": jit(_logarithms)}


def numbers(name):
    """Numbers of every size that the function takes."""
    parts = [np.arange(low, high, STEP, np.int64) for low, high in BITS[name]]
    return np.concatenate(parts).astype(np.uint32).view(np.float32)


def values(name, x):
    out = np.empty_like(x)
    KERNELS[name](x, out)
    return out


@pytest.mark.parametrize("name", BITS)
def test_every_value_is_the_rounded_one_but_for_a_part_of_the_last_place(name):
    x = numbers(name)
    with np.errstate(over="ignore"):
        wanted = ORACLE[name](x.astype(np.float64))
    inside = (np.abs(wanted) > 1.2e-38) & (np.abs(wanted) < 3.4e38)
    place = np.spacing(np.abs(wanted[inside].astype(np.float32))).astype(np.float64)
    least = {"expf": 0.502, "logf": 0.82}[name]
    assert np.max(np.abs(values(name, x)[inside] - wanted[inside]) / place) < least
    assert inside.sum() > 400_000


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="another system has another C library")
@pytest.mark.parametrize("name", BITS)
def test_the_bits_are_those_of_the_c_library(name):
    """A fused multiply-add of the library may change the rounding of one number in 10^8."""
    library = getattr(ctypes.CDLL(ctypes.util.find_library("m")), name)
    library.restype, library.argtypes = ctypes.c_float, [ctypes.c_float]
    x = numbers(name)[::7]
    theirs = np.array([library(float(v)) for v in x], np.float32)
    assert np.count_nonzero(theirs.view(np.int32) != values(name, x).view(np.int32)) <= 1


def test_the_ends():
    x = np.array([0, -0.0, 89, -104, 1e30, -1e30, np.inf, -np.inf, np.nan], np.float32)
    assert np.array_equal(
        values("expf", x), np.array([1, 1, np.inf, 0, np.inf, 0, np.inf, 0, np.nan], np.float32), True
    )
    assert values("logf", np.ones(1, np.float32)) == 0


@pytest.mark.parametrize("name", BITS)
def test_without_the_compiler_the_values_are_the_same(name):
    x = numbers(name)[:: len(numbers(name)) // 500]
    with np.errstate(over="ignore"):
        plain = [OWN[name](v) for v in x]
    assert {type(v) for v in plain} == {np.float32}
    assert np.array_equal(np.array(plain), values(name, x))


def test_kernels_use_it():
    """`test_lowering.py` looks at the compiled kernels."""
    calls = [file.name for file in kernel_sources() if re.search(r"(math|np)\.exp\(", file.read_text(encoding="utf-8"))]
    assert set(calls) <= {"elementary.py", "masked_ssim.py", "texture.py"}, calls  # the latter two outside of kernels


@pytest.mark.parametrize("name", BITS)
def test_float64_is_that_of_the_c_library(name):
    x = np.linspace(0.1, 3, 50)
    assert np.allclose(values(name, x), ORACLE[name](x), rtol=5e-16, atol=5e-16)
