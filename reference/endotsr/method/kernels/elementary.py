"""Exponential and logarithm of float32, bitwise equal on every system.

Results of `expf` and `logf` differ between C libraries. These functions use the algorithms and coefficients of Arm's
optimised routines (MIT licence), which glibc uses too. They compute in float64 and round once; a fused multiply-add
there changes about one result in 10^8. Loops over them vectorise.

    exp:  x = (k + r) ln 2 / 32 with integer k and |r| <= 1/2;  e^x = 2^(k / 32) p(r), the power by table and exponent
    log:  x = 2^k z, z near 1 / c of a table of 16;  log x = k ln 2 + log c + p(z c - 1)

Float64 calls the C library, whose last bit may differ between systems.
"""

import math

import numpy as np
from numba import types
from numba.extending import overload


def _hex(*rows: str) -> "np.ndarray":
    return np.array([float.fromhex(row) for row in rows])


_STEPS = np.int64(32)
_INV_LN2 = 32 * float.fromhex("0x1.71547652b82fep+0")
_TO_INTEGER = float.fromhex("0x1.8p+52")  # adding it moves the rounded integer of a number into the last bits
_E0, _E1, _E2 = (
    _hex("0x1.c6af84b912394p-5", "0x1.ebfce50fac4f3p-3", "0x1.62e42ff0c52d6p-1") / (32**3, 32**2, 32)
).tolist()
_LARGEST = 700.0  # beyond it the result is 0 or infinite in float32, and the exponent bits would overflow
_POWERS = _hex(
    "0x1.0000000000000p+0",
    "0x1.059b0d3158574p+0",
    "0x1.0b5586cf9890fp+0",
    "0x1.11301d0125b51p+0",
    "0x1.172b83c7d517bp+0",
    "0x1.1d4873168b9aap+0",
    "0x1.2387a6e756238p+0",
    "0x1.29e9df51fdee1p+0",
    "0x1.306fe0a31b715p+0",
    "0x1.371a7373aa9cbp+0",
    "0x1.3dea64c123422p+0",
    "0x1.44e086061892dp+0",
    "0x1.4bfdad5362a27p+0",
    "0x1.5342b569d4f82p+0",
    "0x1.5ab07dd485429p+0",
    "0x1.6247eb03a5585p+0",
    "0x1.6a09e667f3bcdp+0",
    "0x1.71f75e8ec5f74p+0",
    "0x1.7a11473eb0187p+0",
    "0x1.82589994cce13p+0",
    "0x1.8ace5422aa0dbp+0",
    "0x1.93737b0cdc5e5p+0",
    "0x1.9c49182a3f090p+0",
    "0x1.a5503b23e255dp+0",
    "0x1.ae89f995ad3adp+0",
    "0x1.b7f76f2fb5e47p+0",
    "0x1.c199bdd85529cp+0",
    "0x1.cb720dcef9069p+0",
    "0x1.d5818dcfba487p+0",
    "0x1.dfc97337b9b5fp+0",
    "0x1.ea4afa2a490dap+0",
    "0x1.f50765b6e4540p+0",
).view(np.int64) - (np.arange(32) << 47)  # bits of 2^(i / 32), minus the part that adding k puts into the exponent

_LN2 = float.fromhex("0x1.62e42fefa39efp-1")
_L0, _L1, _L2 = _hex("-0x1.00ea348b88334p-2", "0x1.5575b0be00b6ap-2", "-0x1.ffffef20a4123p-2").tolist()
_INVERSES = _hex(
    "0x1.661ec79f8f3bep+0", "0x1.571ed4aaf883dp+0", "0x1.49539f0f010bp+0", "0x1.3c995b0b80385p+0",
    "0x1.30d190c8864a5p+0", "0x1.25e227b0b8eap+0", "0x1.1bb4a4a1a343fp+0", "0x1.12358f08ae5bap+0",
    "0x1.0953f419900a7p+0", "0x1p+0", "0x1.e608cfd9a47acp-1", "0x1.ca4b31f026aap-1",
    "0x1.b2036576afce6p-1", "0x1.9c2d163a1aa2dp-1", "0x1.886e6037841edp-1", "0x1.767dcf5534862p-1",
)  # fmt: skip
_LOGARITHMS = _hex(
    "-0x1.57bf7808caadep-2", "-0x1.2bef0a7c06ddbp-2", "-0x1.01eae7f513a67p-2", "-0x1.b31d8a68224e9p-3",
    "-0x1.6574f0ac07758p-3", "-0x1.1aa2bc79c81p-3", "-0x1.a4e76ce8c0e5ep-4", "-0x1.1973c5a611cccp-4",
    "-0x1.252f438e10c1ep-5", "0x0p+0", "0x1.aa5aa5df25984p-5", "0x1.c5e53aa362eb4p-4",
    "0x1.526e57720db08p-3", "0x1.bc2860d22477p-3", "0x1.1058bc8a07ee1p-2", "0x1.4043057b6ee09p-2",
)  # fmt: skip
_FIRST = np.int32(0x3F330000)  # bits of the smallest z


def _exponential_float32(x):
    wide = np.float64(x)
    wide = _LARGEST if wide > _LARGEST else wide  # NaN passes both lines
    wide = -_LARGEST if wide < -_LARGEST else wide
    z = _INV_LN2 * wide
    shifted = np.float64(z + _TO_INTEGER)
    k, r = shifted.view(np.int64), z - (shifted - _TO_INTEGER)
    power = np.int64(_POWERS[k & (_STEPS - 1)] + (k << np.int64(47))).view(np.float64)
    return np.float32(((_E0 * r + _E1) * (r * r) + (_E2 * r + 1.0)) * power)


def _logarithm_float32(x):
    bits = np.float32(x).view(np.int32)
    steps = np.int32(bits - _FIRST)
    i, k = (steps >> np.int32(19)) & np.int32(15), steps >> np.int32(23)
    z = np.float64(np.int32(bits - (k << np.int32(23))).view(np.float32))
    r = z * _INVERSES[i] - 1.0
    p = _L0 * (r * r) + (_L1 * r + _L2)
    return np.float32(p * (r * r) + ((_LOGARITHMS[i] + np.float64(k) * _LN2) + r))


def _exponential_float64(x):
    return math.exp(x)


def _logarithm_float64(x):
    return math.log(x)


def exponential(x):
    """e^x for a scalar, float32 or float64; inlined when called from a kernel.

    returns  e^x in the dtype of x. float32: within 0.502 of the last place, 0 below -104, infinite above 88.723
    Reverse: e^x, written out where it is used.
    Oracle:  numpy.exp in float64; bitwise, expf of glibc.
    """
    return _exponential_float32(x) if np.asarray(x).dtype == np.float32 else _exponential_float64(x)


def logarithm(x):
    """The natural logarithm of a normal number x > 0, float32 or float64; inlined when called from a kernel.

    returns  log x in the dtype of x. float32: within 0.82 of the last place, and exactly 0 at 1
    Reverse: 1 / x, written out where it is used.
    Oracle:  numpy.log in float64; bitwise, logf of glibc.
    """
    return _logarithm_float32(x) if np.asarray(x).dtype == np.float32 else _logarithm_float64(x)


@overload(exponential, inline="always")
def _exponential_overload(x):
    """Chooses the implementation by type while a kernel is compiled."""
    return _exponential_float32 if x == types.float32 else _exponential_float64


@overload(logarithm, inline="always")
def _logarithm_overload(x):
    """Chooses the implementation by type while a kernel is compiled."""
    return _logarithm_float32 if x == types.float32 else _logarithm_float64
