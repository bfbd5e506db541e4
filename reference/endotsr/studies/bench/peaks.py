"""Peaks of this machine: floating-point operations per second, and memory traffic in bytes per second.

The peaks are measured, because the capacity of a virtual machine depends on the load of its host. The kernels are
compiled with contraction, like the fast path. `endotsr.studies.bench.limits` compares the training stages with these
peaks.
"""

import numba
import numpy as np

from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for, use_threads
from endotsr.studies.bench.clock import repeated
from endotsr.studies.bench.records import Peaks

STEPS = 16  # dependent multiply-adds of one chain
CHAINS = 8  # independent chains per number: enough to hide the latency of an FMA
FMA_NUMBERS_PER_TASK = 4096  # fit into the first-level cache
MEMORY_NUMBERS_PER_TASK = 1 << 16
ARRAY_BYTES = 96 << 20  # of each array of a memory kernel, larger than the caches


def _multiply_add(first, stop, values, f):
    """STEPS steps x <- f x + f in CHAINS chains for every number: 2 operations each, without memory traffic.

    Scalar names, a single array and a constant number of steps let the compiler vectorise the loop over the numbers.
    """
    real = values.dtype.type
    for task in range(first, stop):
        row = values[task]
        for i in range(row.size):
            s = row[i]
            t, u, v, w = s + real(1), s + real(2), s + real(3), s + real(4)
            x, y, z = s + real(5), s + real(6), s + real(7)
            for _ in range(STEPS):
                s = f * s + f
                t = f * t + f
                u = f * u + f
                v = f * v + f
                w = f * w + f
                x = f * x + f
                y = f * y + f
                z = f * z + f
            row[i] = ((s + t) + (u + v)) + ((w + x) + (y + z))


def triad(first, stop, out, left, right, factor):
    """out = left + factor right."""
    begin, end = first * MEMORY_NUMBERS_PER_TASK, min(out.size, stop * MEMORY_NUMBERS_PER_TASK)
    o, x, y = out[begin:end], left[begin:end], right[begin:end]
    for i in range(o.size):
        o[i] = x[i] + factor * y[i]


def update(first, stop, out, left, right, factor):
    """out <- right + factor out, in place, like an optimiser step; `left` is not read."""
    begin, end = first * MEMORY_NUMBERS_PER_TASK, min(out.size, stop * MEMORY_NUMBERS_PER_TASK)
    o, y = out[begin:end], right[begin:end]
    for i in range(o.size):
        o[i] = y[i] + factor * o[i]


_multiply_add_kernel = jit(_multiply_add, contract=True)
_triad_kernel = jit(triad, contract=True)
_update_kernel = jit(update, contract=True)


def fma_peak(precision: str, repeats: int = 7) -> float:
    """Floating-point operations per second with the current threads; a fused multiply-add counts as two."""
    real = np.dtype(precision).type
    tasks = 64 * numba.get_num_threads()
    values = np.ones((tasks, FMA_NUMBERS_PER_TASK), real)
    work = lambda: parallel_for(_multiply_add_kernel, tasks, values, real(0.5))
    return 2.0 * STEPS * CHAINS * values.size / min(repeated(work, repeats, warm_up=2))


def bandwidths(repeats: int = 7, array_bytes: int = ARRAY_BYTES) -> dict[str, float]:
    """Bytes per second with the current threads: "triad" (two reads, one write), "update" (one read, one update).

    As in STREAM, the read of a written cache line (write-allocate) is not counted.
    """
    out, left, right = (np.ones(array_bytes // 4, np.float32) for _ in range(3))
    tasks, factor = -(-out.size // MEMORY_NUMBERS_PER_TASK), np.float32(0.5)
    seconds = {
        name: min(repeated(lambda k=kernel: parallel_for(k, tasks, out, left, right, factor), repeats))
        for name, kernel in (("triad", _triad_kernel), ("update", _update_kernel))
    }
    return {name: 3.0 * out.nbytes / best for name, best in seconds.items()}


def measure_peaks(threads: int) -> Peaks:
    """The best of the repeats."""
    use_threads(threads)
    fma = {precision: fma_peak(precision) for precision in ("float32", "float64")}
    return {"threads": threads, "flop_per_second": fma, "bytes_per_second": bandwidths()}


def higher(before: Peaks, after: Peaks) -> Peaks:
    """The maximum of two measurements for each peak."""

    def best(one: dict[str, float], other: dict[str, float]) -> dict[str, float]:
        return {name: max(value, other[name]) for name, value in one.items()}

    return {
        "threads": before["threads"],
        "flop_per_second": best(before["flop_per_second"], after["flop_per_second"]),
        "bytes_per_second": best(before["bytes_per_second"], after["bytes_per_second"]),
    }
