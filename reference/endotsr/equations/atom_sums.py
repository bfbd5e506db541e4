"""The sum over atoms that equations (2) and (3) share: out[c, i] = sum_a coefficients[c, a, i] atoms[a].

In: coefficients (3, 2F, N), atoms (2F,). Out: (3, N). The sum runs in the order of the atoms, one rounding a step,
so the result does not depend on the block size or the number of threads. The reverse pass adds over the Gaussians in
float64, block by block.
"""

import numpy as np
from numba import prange
from numpy.typing import NDArray

from endotsr.jit import jit

FloatArray = NDArray[np.floating]

BLOCK = 1024  # Gaussians a task; a few rows of a block stay in the first-level cache
LANES = 64  # partial sums side by side: enough to fill the vector units


def _combine(coefficients, atoms, out):
    axes, count, n = coefficients.shape
    zero = coefficients.dtype.type(0.0)
    for block in prange((n + BLOCK - 1) // BLOCK):
        start = block * BLOCK
        stop = min(n, start + BLOCK)
        for c in range(axes):
            total = out[c, start:stop]
            for k in range(total.size):
                total[k] = zero
            for a in range(count):
                row = coefficients[c, a, start:stop]
                atom = atoms[a]
                for k in range(total.size):
                    total[k] += atom * row[k]


def _spread(d_out, coefficients, atoms, d_coefficients, partial):
    axes, count, n = coefficients.shape
    for block in prange((n + BLOCK - 1) // BLOCK):
        start = block * BLOCK
        stop = min(n, start + BLOCK)
        strips = (stop - start) // LANES
        lanes = np.empty(LANES)
        for a in range(count):
            atom = atoms[a]
            for k in range(LANES):
                lanes[k] = 0.0
            rest = 0.0
            for c in range(axes):
                upstream = d_out[c, start:stop]
                row = coefficients[c, a, start:stop]
                d_row = d_coefficients[c, a, start:stop]
                for k in range(upstream.size):
                    d_row[k] = atom * upstream[k]
                for s in range(strips):
                    x = upstream[s * LANES : (s + 1) * LANES]
                    y = row[s * LANES : (s + 1) * LANES]
                    for k in range(LANES):
                        lanes[k] += np.float64(x[k]) * np.float64(y[k])
                for k in range(strips * LANES, upstream.size):
                    rest += np.float64(upstream[k]) * np.float64(row[k])
            for k in range(LANES):
                rest += lanes[k]
            partial[block, a] = rest


_combine_kernel = jit(_combine, parallel=True)
_spread_kernel = jit(_spread, parallel=True)


def combine(coefficients: FloatArray, atoms: FloatArray) -> FloatArray:
    """out[c, i] = sum_a coefficients[c, a, i] atoms[a]. (3, 2F, N), (2F,) -> (3, N)"""
    if coefficients.ndim != 3 or atoms.shape != coefficients.shape[1:2]:
        raise ValueError(f"coefficients {coefficients.shape} and atoms {atoms.shape}; expected (3, 2F, N) and (2F,)")
    coefficients = np.ascontiguousarray(coefficients)
    out = np.empty((coefficients.shape[0], coefficients.shape[2]), coefficients.dtype)
    _combine_kernel(coefficients, np.ascontiguousarray(atoms, coefficients.dtype), out)
    return out


def spread(d_out: FloatArray, coefficients: FloatArray, atoms: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Reverse of `combine`: (derivative by the coefficients (3, 2F, N), derivative by the atoms (2F,))."""
    dtype = coefficients.dtype
    coefficients = np.ascontiguousarray(coefficients)
    if d_out.shape != (coefficients.shape[0], coefficients.shape[2]):
        raise ValueError(f"upstream {d_out.shape} does not fit coefficients {coefficients.shape}")
    d_coefficients = np.empty(coefficients.shape, dtype)
    blocks = (coefficients.shape[2] + BLOCK - 1) // BLOCK
    partial = np.zeros((blocks, coefficients.shape[1]))
    d_out = np.ascontiguousarray(d_out, dtype)
    _spread_kernel(d_out, coefficients, np.ascontiguousarray(atoms, dtype), d_coefficients, partial)
    return d_coefficients, partial.sum(axis=0).astype(dtype)
