"""Sums over all Gaussians in a fixed order, independent of the threads and of visibility."""

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for


def _block_sums(first, stop, rows, length, sums):
    """Row sums of blocks of `length` columns, in their order; a block writes one row of `sums`."""
    for block in range(first, stop):
        for row in range(rows.shape[0]):
            total = rows.dtype.type(0)
            for i in range(block * length, min(rows.shape[1], (block + 1) * length)):
                total += rows[row, i]
            sums[block, row] = total


_block_sums_kernel = jit(_block_sums)


def sum_columns(rows: FloatArray, length: int) -> FloatArray:
    """Sum of the columns of `rows` (K, N), shape (K,), in their dtype: blocks of `length` columns, then the blocks."""
    blocks = -(-rows.shape[1] // length)
    sums = np.empty((blocks, rows.shape[0]), rows.dtype)
    parallel_for(_block_sums_kernel, blocks, rows, length, sums)
    return sums.sum(axis=0)
