"""Gathering of columns: the one move by which arrays with one column per Gaussian are reordered, grown and thinned.

In: an array whose last axis is the index, and the source column of every new one. Out: a new array. Nothing here knows
what the columns mean.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.arrays import FloatArray
from endotsr.kernels.jit import jit
from endotsr.kernels.threads import parallel_for


def gather_columns(array: FloatArray, source: NDArray[np.intp], kept: int) -> FloatArray:
    """array[..., source] as a new C-contiguous array, with zeros in the columns from `kept` on.

    array    (..., N)  any leading axes
    source   (M,)      indices in [0, N); those from `kept` on are not read
    returns  (..., M)  same dtype
    """
    out = np.empty((*array.shape[:-1], source.size), array.dtype)
    if out.size:
        rows = array.size // array.shape[-1]
        columns = np.ascontiguousarray(array).reshape(rows, -1)
        parallel_for(_gather_kernel, rows, columns, source, kept, out.reshape(rows, -1))
    return out


def _gather(first, stop, columns, source, kept, out):
    """Each task owns one row."""
    for row in range(first, stop):
        from_row, to_row = columns[row], out[row]
        for i in range(kept):
            to_row[i] = from_row[source[i]]
        for i in range(kept, source.size):
            to_row[i] = from_row.dtype.type(0)


_gather_kernel = jit(_gather)
