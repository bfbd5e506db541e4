"""The sum over atoms that equations (2) and (3) share: out[c, i] = sum_a coefficients[c, a, i] atoms[a].

In: coefficients (3, 2F, N), atoms (2F,). Out: (3, N). Atoms are summed in order, and each product and each sum is
rounded to the dtype of the coefficients. The result does not depend on the block size or the number of threads. The
reverse pass sums over the Gaussians in float64, block by block.
"""

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for

GAUSSIANS_PER_TASK = 1024  # Gaussians per task; a few rows of a block fit in the first-level cache
LANES = 64  # independent partial sums, enough to fill the vector units


def _combine(first, last, coefficients, atoms, out):
    axes, count, n = coefficients.shape
    zero = coefficients.dtype.type(0.0)
    for block in range(first, last):
        start = block * GAUSSIANS_PER_TASK
        stop = min(n, start + GAUSSIANS_PER_TASK)
        for c in range(axes):
            total = out[c, start:stop]
            for k in range(total.size):
                total[k] = zero
            for a in range(count):
                row = coefficients[c, a, start:stop]
                atom = atoms[a]
                for k in range(total.size):
                    total[k] += atom * row[k]


def _spread(first, last, d_out, atoms, d_coefficients):
    axes, count, n = d_coefficients.shape
    for block in range(first, last):
        start = block * GAUSSIANS_PER_TASK
        stop = min(n, start + GAUSSIANS_PER_TASK)
        for c in range(axes):
            upstream = d_out[c, start:stop]
            for a in range(count):
                atom = atoms[a]
                row = d_coefficients[c, a, start:stop]
                for k in range(row.size):
                    row[k] = atom * upstream[k]


def _atom_totals(first, last, d_out, coefficients, partial):
    axes, count, n = coefficients.shape
    lanes = np.empty(LANES)
    for block in range(first, last):
        start = block * GAUSSIANS_PER_TASK
        stop = min(n, start + GAUSSIANS_PER_TASK)
        strips = (stop - start) // LANES
        for a in range(count):
            for k in range(LANES):
                lanes[k] = 0.0
            rest = 0.0
            for c in range(axes):
                upstream, row = d_out[c, start:stop], coefficients[c, a, start:stop]
                for s in range(strips):
                    x, y = upstream[s * LANES :], row[s * LANES :]
                    for k in range(LANES):
                        lanes[k] += np.float64(x[k]) * np.float64(y[k])
                for k in range(strips * LANES, upstream.size):
                    rest += np.float64(upstream[k]) * np.float64(row[k])
            for k in range(LANES):
                rest += lanes[k]
            partial[block, a] = rest


def _blocks(n: int) -> int:
    return (n + GAUSSIANS_PER_TASK - 1) // GAUSSIANS_PER_TASK


_combine_kernel = jit(_combine)
_spread_kernel = jit(_spread)
_atom_totals_kernel = jit(_atom_totals)


def combine(coefficients: FloatArray, atoms: FloatArray) -> FloatArray:
    """out[c, i] = sum_a coefficients[c, a, i] atoms[a]. (3, 2F, N), (2F,) -> (3, N)"""
    if coefficients.ndim != 3 or atoms.shape != coefficients.shape[1:2]:
        raise ValueError(f"coefficients {coefficients.shape} and atoms {atoms.shape}; expected (3, 2F, N) and (2F,)")
    coefficients = np.ascontiguousarray(coefficients)
    out = np.empty((coefficients.shape[0], coefficients.shape[2]), coefficients.dtype)
    atoms = np.ascontiguousarray(atoms, coefficients.dtype)
    parallel_for(_combine_kernel, _blocks(out.shape[1]), coefficients, atoms, out)
    return out


def spread(
    d_out: FloatArray, coefficients: FloatArray, atoms: FloatArray, *, atom_gradient: bool = True
) -> tuple[FloatArray, FloatArray | None]:
    """Reverse of `combine`: gradients of the coefficients (3, 2F, N) and, if requested, of the atoms (2F,)."""
    dtype = coefficients.dtype
    if d_out.shape != (coefficients.shape[0], coefficients.shape[2]):
        raise ValueError(f"d_out {d_out.shape} and coefficients {coefficients.shape}; expected (3, N) and (3, 2F, N)")
    d_out = np.ascontiguousarray(d_out, dtype)
    d_coefficients, tasks = np.empty(coefficients.shape, dtype), _blocks(coefficients.shape[2])
    parallel_for(_spread_kernel, tasks, d_out, np.ascontiguousarray(atoms, dtype), d_coefficients)
    if not atom_gradient:
        return d_coefficients, None
    partial = np.zeros((tasks, coefficients.shape[1]))
    parallel_for(_atom_totals_kernel, tasks, d_out, np.ascontiguousarray(coefficients), partial)
    return d_coefficients, partial.sum(axis=0).astype(dtype)
