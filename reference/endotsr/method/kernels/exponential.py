"""2^x for x <= 0 as straight-line arithmetic, which vectorises in loops over pixels and Gaussians.

The library exponential is a scalar call inside a compiled loop; this one is a polynomial and a shift.
Split x = k + f with k = trunc(x) and f in (-1, 0]. 2^f is a polynomial with p(0) = 1 and p(-1) = 1/2
exactly, so it is continuous across k and 2^0 is exactly 1. 2^k is built from its exponent bits.

Polynomials: float32 degree 6, minimax in relative error (2.2e-9, and 1.4e-8 with the coefficients in float32);
float64 degree 11, interpolation at Chebyshev nodes (5.5e-17). With rounding: 2e-7 and 4.5e-16 relative; the tests
allow 3e-7 and 1e-15.
"""

import numpy as np
from numba import types
from numba.extending import overload

LOG2_E = 1.4426950408889634  # exp(x) = 2^(x LOG2_E)

_F1 = np.float32(0.6931470559964727)
_F2 = np.float32(0.24022424257980557)
_F3 = np.float32(0.0554901454231456)
_F4 = np.float32(0.00957787825246986)
_F5 = np.float32(0.001273494355488244)
_F6 = np.float32(0.00010857494283537357)

_D1 = 0.6931471805599453
_D2 = 0.2402265069590985
_D3 = 0.05550410866473285
_D4 = 0.009618129106241331
_D5 = 0.001333355803508817
_D6 = 0.0001540352517215062
_D7 = 1.5252580836125649e-05
_D8 = 1.3212599041458506e-06
_D9 = 1.0142862251827564e-07
_D10 = 6.785037152904477e-09
_D11 = 3.2435703048209343e-10


def _exp2_float32(x):
    x = max(x, np.float32(-126))
    k = np.int32(x)
    f = x - np.float32(k)
    p = (((((_F6 * f + _F5) * f + _F4) * f + _F3) * f + _F2) * f + _F1) * f + np.float32(1)
    return p * np.int32((k + np.int32(127)) << np.int32(23)).view(np.float32)


def _exp2_float64(x):
    x = max(x, np.float64(-1022))
    k = np.int64(x)
    f = x - np.float64(k)
    p = ((((_D11 * f + _D10) * f + _D9) * f + _D8) * f + _D7) * f + _D6
    p = (((((p * f + _D5) * f + _D4) * f + _D3) * f + _D2) * f + _D1) * f + np.float64(1)
    return p * np.int64((k + np.int64(1023)) << np.int64(52)).view(np.float64)


def exp2_nonpositive(x):
    """2^x for a scalar x <= 0, float32 or float64; inlined when called from a kernel.

    x        <= 0; below -126 (float32) or -1022 (float64) the result stays at the smallest normal number
    returns  2^x in the dtype of x; exactly 1 at x = 0, exactly 2^k at integer x = k
    Reverse: ln(2) 2^x, written out where it is used.
    Oracle:  numpy.exp2.
    """
    return _exp2_float32(x) if np.asarray(x).dtype == np.float32 else _exp2_float64(np.float64(x))


@overload(exp2_nonpositive, inline="always")
def _exp2_nonpositive_overload(x):
    """Chooses the implementation by type while a kernel is compiled."""
    return _exp2_float32 if x == types.float32 else _exp2_float64
