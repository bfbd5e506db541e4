"""Equation (2): the bounded colour residual of component A.

In: coefficients A (3, 2F, N), dimensionless, and the normalised atoms phi_bar(t) (2F,). Out: the residual (3, N),
beta tanh(A phi_bar) / Y00, in units of the degree-0 harmonic coefficient. Added to that coefficient, it changes the
displayed colour by beta tanh(A phi_bar) before the clamp at 0.
"""

import math
from typing import NamedTuple

import numpy as np

from endotsr.method.equations.atom_sums import combine, spread
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.constants import Y00
from endotsr.method.kernels.exponential import LOG2_E, exp2_nonpositive
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for

LN2_HIGH = 355.0 / 512.0  # ln 2 in nine bits: k * LN2_HIGH is exact for every exponent k of either precision
LN2_LOW = -2.1219444005469058e-4  # ln 2 - LN2_HIGH
SATURATED = 1e4  # exp(-1e4) is below the smallest number of either precision


class AppearanceSaved(NamedTuple):
    """References to the inputs and the derivative of the squashing."""

    appearance_coefficients: FloatArray  # (3, 2F, N)
    phi_bar: FloatArray  # (2F,)
    slope: FloatArray  # (3, N)  beta tanh'(A phi_bar) / Y00


class AppearanceGrads(NamedTuple):
    """Derivative with respect to the coefficients and the atoms."""

    d_appearance_coefficients: FloatArray  # (3, 2F, N)
    d_phi_bar: FloatArray | None  # (2F,), None unless requested


def _exp_nonpositive(z):
    """exp(-z) for z >= 0 by straight-line arithmetic, accurate to a few ulp down to the smallest normal number.

    In place of a smaller exponential it returns a number between half of that number and that number.
    z = k ln 2 + r: the product k * LN2_HIGH is exact, so r keeps full precision; 2^(-z log2 e) would lose
    the digits of the integer part of z.
    """
    real = type(z)
    z = real(SATURATED) if z > real(SATURATED) else z
    k = real(math.floor(z * real(LOG2_E)))
    r = (z - k * real(LN2_HIGH)) - k * real(LN2_LOW)
    return exp2_nonpositive(-k) * exp2_nonpositive(-(r * real(LOG2_E)))


_exp_nonpositive_kernel = jit(_exp_nonpositive)


def _tanh_and_slope(x):
    """tanh x to a few ulp for all x, and its derivative to a few ulp up to |x| = 350 (float64) and 43 (float32).

    With e = exp(-2|x|): tanh |x| = (1 - e) / (1 + e) and tanh' = 4 e / (1 + e)^2. The textbook 1 - tanh^2
    loses every digit of a saturated residual (0 from x = 10 in float32), which could then never recover.
    1 - e cancels for small |x|; there the seventh convergent of the continued fraction
    x / (1 + x^2 / (3 + x^2 / (5 + ...))) is used.
    """
    real = type(x)
    size = abs(x)
    e = _exp_nonpositive_kernel(size + size)
    one_more = real(1.0) + e
    large = (real(1.0) - e) / one_more
    q = min(x * x, real(1.0))  # the convergent is used only below 1/2; the bound prevents overflow elsewhere
    numerator = real(135135.0) + q * (real(17325.0) + q * (real(378.0) + q))
    denominator = real(135135.0) + q * (real(62370.0) + q * (real(3150.0) + q * real(28.0)))
    small = size * (numerator / denominator)
    value = small if size < real(0.5) else large
    return math.copysign(value, x), real(4.0) * (e / one_more) / one_more


_tanh_and_slope_kernel = jit(_tanh_and_slope)


def _squash(first, stop, argument, scale, residual, slope):
    x, value, derivative = argument[first:stop], residual[first:stop], slope[first:stop]
    for k in range(x.size):
        v, d = _tanh_and_slope_kernel(x[k])
        value[k] = scale * v
        derivative[k] = scale * d


_squash_kernel = jit(_squash)


def appearance_forward(
    appearance_coefficients: FloatArray, phi_bar: FloatArray, beta: float
) -> tuple[FloatArray, AppearanceSaved]:
    """Equation (2): residual = beta tanh(A phi_bar(t)) / Y00.

    appearance_coefficients  (3, 2F, N)  A, dimensionless; [colour channel, atom, Gaussian]
    phi_bar              (2F,)       normalised atoms of equation (1b) at this time
    beta                 ()          bound of the residual, display units [0, 1], > 0
    returns              (3, N) residual in units of the degree-0 harmonic coefficient, |residual| <= beta / Y00,
                         dtype of A; and the saved tuple
    Reverse: appearance_reverse, below.
    Edges:   A = 0 gives exactly 0, so the base colour is bitwise unchanged. A saturated residual is finite, and its
             derivative is accurate up to |A phi_bar| = 350 (float64) and 43 (float32).
    Raises:  ValueError if the shapes disagree or beta is not finite and positive.
    Oracle:  `endotsr.definition.appearance`
    """
    if not (math.isfinite(beta) and beta > 0):
        raise ValueError(f"beta {beta}; use a finite number > 0")
    argument = combine(appearance_coefficients, phi_bar)
    residual, slope = np.empty_like(argument), np.empty_like(argument)
    x, value, derivative = argument.reshape(-1), residual.reshape(-1), slope.reshape(-1)
    parallel_for(_squash_kernel, x.size, x, argument.dtype.type(beta / Y00), value, derivative)
    return residual, AppearanceSaved(appearance_coefficients, phi_bar, slope)


def appearance_reverse(
    d_residual: FloatArray, saved: AppearanceSaved, *, atom_gradient: bool = True
) -> AppearanceGrads:
    """Reverse of equation (2).

    d_residual  (3, N)  derivative of the loss with respect to the residual, as to the degree-0 coefficient
    returns     gradients of A (3, 2F, N) and phi_bar (2F,), the latter summed in float64, None unless `atom_gradient`
    Edges:      A = 0 has derivative (beta / Y00) phi_bar d_residual, not zero: training can leave A = 0.
    """
    d_argument = argument_gradient(d_residual, saved)
    return AppearanceGrads(
        *spread(d_argument, saved.appearance_coefficients, saved.phi_bar, atom_gradient=atom_gradient)
    )


def argument_gradient(d_residual: FloatArray, saved: AppearanceSaved) -> FloatArray:
    """First half of the reverse pass: derivative (3, N) with respect to A phi_bar, the argument of tanh."""
    return np.multiply(d_residual, saved.slope, dtype=saved.slope.dtype)
