"""Column gather: reorders, extends and prunes arrays with one column per Gaussian.

In: an array whose last axis is the index, and the source column of every new column. Out: a new array.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for

HEADROOM = 1.5  # allocated over needed memory of a regathered array: pages that are never written cost nothing


def gather_columns(array: FloatArray, source: NDArray[np.intp], kept: int) -> FloatArray:
    """array[..., source] as a new C-contiguous array, with zeros in the columns from `kept` on.

    array    (..., N)  any leading axes
    source   (M,)      indices in [0, N); those from `kept` on are not read
    returns  (..., M)  same dtype
    """
    return _gathered(array, source, kept, np.empty((*array.shape[:-1], source.size), array.dtype))


def _gathered(array: FloatArray, source: NDArray[np.intp], kept: int, out: FloatArray) -> FloatArray:
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


def regather_columns(array: FloatArray, source: NDArray[np.intp], kept: int) -> FloatArray:
    """As `gather_columns`, in place if the memory of `array` is large enough; `array` must not be used afterwards.

    The system zeroes every new page of memory; for 60 000 Gaussians this took longer than the gather. The order of the
    moves ensures that no row is overwritten before it is read.
    """
    need, room = array.size // max(array.shape[-1], 1) * source.size, array.base
    fits = room is not None and room.ndim == 1 and room.dtype == array.dtype and room.size >= need
    if room is None or not fits or room.ctypes.data != array.ctypes.data or not array.size:
        room = np.empty(int(HEADROOM * need), array.dtype)
        return _gathered(array, source, kept, room[:need].reshape(*array.shape[:-1], source.size))
    _regather_kernel(room, array.size // array.shape[-1], array.shape[-1], source, kept)
    return room[:need].reshape(*array.shape[:-1], source.size)


def _regather(room, rows, before, source, kept):
    """Change the row length from `before` to source.size."""
    count, row_before = source.size, np.empty(before, room.dtype)
    for k in range(rows):
        row = k if count <= before else rows - 1 - k
        row_before[:] = room[row * before : (row + 1) * before]
        to_row = room[row * count : (row + 1) * count]
        for i in range(kept):
            to_row[i] = row_before[source[i]]
        for i in range(kept, count):
            to_row[i] = room.dtype.type(0)


_regather_kernel = jit(_regather)
