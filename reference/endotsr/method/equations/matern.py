"""Equation (4): Matern-5/2 weights of the frequencies, and the penalty on motion that they weight.

In: frequencies (F,) in cycles per unit of normalised time, the correlation length l, the motion coefficients
C (3, 2F, N) in scene units. Out: weights rho (F,), dimensionless with mean 1; the penalty, a scalar in squared
scene units, invariant to the phase of every sine/cosine pair.
"""

import math
from typing import NamedTuple

import numpy as np

from endotsr.method.equations.atom_sums import LANES
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for


class MaternSaved(NamedTuple):
    """References to the inputs of the forward pass."""

    motion_coefficients: FloatArray  # (3, 2F, N)
    rho: FloatArray  # (F,)


def matern_weights(omega: FloatArray, length: float) -> FloatArray:
    """Equation (4), upper line: rho_f proportional to (5/l^2 + (2 pi omega_f)^2)^3, scaled to mean 1.

    This is the reciprocal spectral density of the Matern-5/2 prior. It is evaluated relative to the largest frequency
    and is therefore finite for every l >= 0; the printed formula overflows below l = 9e-52 (8e-7 in float32).

    omega    (F,)  cycles per unit of normalised time, finite, > 0
    length   ()    l, normalised time, >= 0; 0 weights all frequencies equally, inf gives omega^6
    returns  (F,)  rho, dimensionless, mean 1, not decreasing with omega; dtype of omega
    Reverse: none (constant in training).
    Raises:  ValueError if the length is negative or NaN, or a frequency is not finite and positive.
    Oracle:  1 / Student-t density with 5 degrees of freedom and scale 1/l; mpmath.
    """
    if not length >= 0:
        raise ValueError(f"correlation length {length}; use a number >= 0")
    if omega.ndim != 1 or omega.size == 0 or not np.all(np.isfinite(omega) & (omega > 0)):
        raise ValueError(f"frequencies {omega}; use finite numbers > 0 of shape (F,)")
    wide = omega.astype(np.float64)
    ratio = wide / wide.max()
    scaled = length * (2.0 * np.pi * float(wide.max()))  # l times the largest angular frequency
    if scaled >= math.sqrt(5.0):
        small = 5.0 / scaled / scaled
        density = ((small + ratio**2) / (1.0 + small)) ** 3
    else:
        density = ((5.0 + (scaled * ratio) ** 2) / (5.0 + scaled**2)) ** 3
    return (density / (math.fsum(density) / density.size)).astype(omega.dtype)


def _row_square_sums(first, stop, rows, sums):
    """sums[r] = sum over n of rows[r, n]^2 in float64, in an order that depends only on the row length."""
    n = rows.shape[1]
    strips = n // LANES
    lanes = np.empty(LANES)
    for r in range(first, stop):
        row = rows[r]
        for k in range(LANES):
            lanes[k] = 0.0
        for s in range(strips):
            strip = row[s * LANES :]
            for k in range(LANES):
                v = np.float64(strip[k])
                lanes[k] += v * v
        total = 0.0
        for k in range(strips * LANES, n):
            v = np.float64(row[k])
            total += v * v
        for k in range(LANES):
            total += lanes[k]
        sums[r] = total


def _scale_rows(first, stop, rows, factors, out):
    for r in range(first, stop):
        row = rows[r]
        target = out[r]
        factor = factors[r]
        for k in range(row.size):
            target[k] = factor * row[k]


_row_square_sums_kernel = jit(_row_square_sums)
_scale_rows_kernel = jit(_scale_rows)


def matern_penalty_forward(motion_coefficients: FloatArray, rho: FloatArray) -> tuple[float, MaternSaved]:
    """Equation (4), lower line: L_msp = 1/(6 N F) sum_i sum_f rho_f (|C_sin,f|^2 + |C_cos,f|^2) over three axes.

    motion_coefficients  (3, 2F, N)  C, scene units; all sines, then all cosines
    rho                  (F,)        weights
    returns              the mean weighted square, squared scene units, summed in float64; and the saved tuple
    Reverse: matern_penalty_reverse, below.
    Edges:   N = 0 gives 0.
    Raises:  ValueError if the shapes disagree.
    Oracle:  `endotsr.definition.matern`
    """
    axes, atoms, n = motion_coefficients.shape
    count = rho.size
    if axes != 3 or atoms != 2 * count:
        raise ValueError(f"coefficients {motion_coefficients.shape} and rho {rho.shape}; expected (3, 2F, N) and (F,)")
    saved = MaternSaved(motion_coefficients, rho)
    if n == 0:
        return 0.0, saved
    sums = np.empty(axes * atoms)
    rows = np.ascontiguousarray(motion_coefficients).reshape(axes * atoms, n)
    parallel_for(_row_square_sums_kernel, sums.size, rows, sums)
    energy = sums.reshape(axes, 2, count).sum(axis=(0, 1))
    return math.fsum(rho.astype(np.float64) * energy) / (6.0 * n * count), saved


def penalty_factors(d_penalty: float, rho: FloatArray, count: int, dtype: np.dtype) -> FloatArray:
    """rho_f d_penalty / (3 N F) of every atom (2F,), N = max(count, 1); times C, it is the penalty's gradient."""
    factor = rho.astype(np.float64) * (float(d_penalty) / (3.0 * max(count, 1) * rho.size))
    return np.tile(factor, 2).astype(dtype)


def matern_penalty_reverse(d_penalty: float, saved: MaternSaved) -> FloatArray:
    """Reverse of equation (4): rho_f C / (3 N F) times d_penalty. Shape (3, 2F, N), dtype of C."""
    coefficients, rho = saved
    axes, atoms, n = coefficients.shape
    out = np.empty(coefficients.shape, coefficients.dtype)
    if n == 0:
        return out
    factors = np.tile(penalty_factors(d_penalty, rho, n, coefficients.dtype), axes)
    rows = np.ascontiguousarray(coefficients).reshape(axes * atoms, n)
    parallel_for(_scale_rows_kernel, axes * atoms, rows, factors, out.reshape(axes * atoms, n))
    return out
