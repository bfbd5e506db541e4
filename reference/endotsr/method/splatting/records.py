"""The records of Gaussians and of their gradients for compositing, packed in depth order.

The exponent of a Gaussian on the screen is -q/2 with q = r dy^2 + A (dx - m dy)^2, A = c/det, m = b/c, r = 1/c.
This sum of squares is never negative and stays accurate for needles (B5). A record of 11 numbers occupies one or two
cache lines (float64: two or three). A gradient record has 10 numbers.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.elementary import exponential, logarithm
from endotsr.method.kernels.exponential import LOG2_E
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.kernels.vectors import prefetch
from endotsr.method.splatting.binning import TileLists
from endotsr.method.splatting.projection import Projected

# columns of a record
U, V, PRECISION, SLOPE, INVERSE_C, LOG2_OPACITY, RED, GREEN, BLUE, DEPTH, OPACITY = range(11)
RECORD = 11

# columns of a gradient record: sums over pixels, s = dL/d(exponent), e = dx - m dy, w = alpha T
SUM_S, SUM_SE, SUM_SY, SUM_SEE, SUM_SEY, SUM_SYY, SUM_RED, SUM_GREEN, SUM_BLUE, SUM_DEPTH = range(10)
GRADIENT = 10

GRADIENTS_AHEAD = 16  # pairs between the prefetch of a gradient record and its addition


def _log_sigmoid(first, stop, logit, out):
    """log(1 / (1 + exp(-x))) without overflow at either end."""
    real = logit.dtype.type
    zero, one = real(0), real(1)
    for i in range(first, stop):
        x = logit[i]
        out[i] = min(x, zero) - logarithm(one + exponential(-abs(x)))


_log_sigmoid_kernel = jit(_log_sigmoid)


def log_opacity(opacity_logit: FloatArray) -> FloatArray:
    """Natural log of the opacity sigmoid(logit), (N,), finite for every finite logit."""
    out = np.empty_like(opacity_logit)
    parallel_for(_log_sigmoid_kernel, out.size, opacity_logit, out)
    return out


def _pack(first, stop, order, mean2d, covariance2d, determinant, log_opacity, colour, depth, out):
    real = mean2d.dtype.type
    one, log2_e = real(1), real(LOG2_E)
    for k in range(first, stop):
        i = order[k]
        b, c = covariance2d[1, i], covariance2d[2, i]
        record = out[k]
        record[U], record[V] = mean2d[0, i], mean2d[1, i]
        record[PRECISION], record[SLOPE], record[INVERSE_C] = c / determinant[i], b / c, one / c
        record[LOG2_OPACITY] = log_opacity[i] * log2_e
        record[RED], record[GREEN], record[BLUE] = colour[0, i], colour[1, i], colour[2, i]
        record[DEPTH] = depth[i]
        record[OPACITY] = exponential(log_opacity[i])


_pack_kernel = jit(_pack)


def pack_records(
    order: NDArray[np.int32],
    projected: Projected,
    log_opacity: FloatArray,
    colour: FloatArray,
) -> FloatArray:
    """Records (n, 11) of the Gaussians named by `order`, nearest first; n <= N."""
    dtype = projected.depth.dtype
    out = np.empty((order.size, RECORD), dtype)
    parallel_for(
        _pack_kernel, order.size,
        order, projected.mean2d, projected.covariance2d, projected.determinant, log_opacity, colour,
        projected.depth, out,
    )  # fmt: skip
    return out


class FootprintGrads(NamedTuple):
    """Gradients of the drawn Gaussians; zero for all others."""

    d_mean2d: FloatArray  # (2, N)
    d_footprint: FloatArray  # (3, N) with respect to A, m, r
    d_logit: FloatArray  # (N,)
    d_colour: FloatArray  # (3, N)
    d_depth: FloatArray  # (N,)


def _gather(
    first, stop,
    order, records, pair_starts, slots, pair_gradients, determinant, opacity_logit, conic_epsilon, keep_depth, out,
):  # fmt: skip
    """Add the pair gradients of each Gaussian in tile order and convert the sums to gradients of its parameters."""
    d_mean2d, d_footprint, d_logit, d_colour, d_depth = out
    real = records.dtype.type
    half, one, zero, largest = real(0.5), real(1), real(0), real(700)
    total = np.empty(GRADIENT, records.dtype)
    for k in range(first, stop):
        for j in range(GRADIENT):
            total[j] = zero
        for p in range(pair_starts[k], pair_starts[k + 1]):
            if p + GRADIENTS_AHEAD < slots.size:  # the rows are in random order: each would be a cache miss
                prefetch(pair_gradients, slots[p + GRADIENTS_AHEAD])
            row = pair_gradients[slots[p]]
            for j in range(GRADIENT):
                total[j] += row[j]
        i = order[k]
        a, m, r = records[k, PRECISION], records[k, SLOPE], records[k, INVERSE_C]
        d_mean2d[0, i] = a * total[SUM_SE]
        d_mean2d[1, i] = r * total[SUM_SY] - a * m * total[SUM_SE]
        factor = one
        if conic_epsilon > zero:
            factor = one / (one + conic_epsilon / determinant[i] / determinant[i])  # det^2 overflows for huge splats
        d_footprint[0, i] = factor * (-half * total[SUM_SEE])
        d_footprint[1, i] = factor * (a * total[SUM_SEY])
        d_footprint[2, i] = factor * (-half * total[SUM_SYY])
        # sum of s, times 1 - opacity; the bound keeps a float64 from raising with the JIT off
        d_logit[i] = total[SUM_S] / (one + exponential(min(opacity_logit[i], largest)))
        d_colour[0, i], d_colour[1, i], d_colour[2, i] = total[SUM_RED], total[SUM_GREEN], total[SUM_BLUE]
        d_depth[i] = total[SUM_DEPTH] if keep_depth else zero


_gather_kernel = jit(_gather)


def gather_footprint_gradients(
    order: NDArray[np.int32],
    records: FloatArray,
    lists: TileLists,
    pair_gradients: FloatArray,
    determinant: FloatArray,
    opacity_logit: FloatArray,
    *,
    conic_epsilon: float,
    keep_depth: bool,
) -> FootprintGrads:
    """As `gather_gradients`, but with respect to A, m, r of the footprint (3, N) instead of covariance2d."""
    n, dtype = determinant.size, records.dtype
    out = FootprintGrads(*(np.zeros(shape, dtype) for shape in ((2, n), (3, n), n, (3, n), n)))
    parallel_for(
        _gather_kernel, order.size,
        order, records, lists.pair_starts, lists.slots, pair_gradients, determinant, opacity_logit,
        dtype.type(conic_epsilon), keep_depth, out,
    )  # fmt: skip
    return out


def gather_gradients(
    order: NDArray[np.int32],
    records: FloatArray,
    lists: TileLists,
    pair_gradients: FloatArray,
    determinant: FloatArray,
    opacity_logit: FloatArray,
    *,
    conic_epsilon: float,
    keep_depth: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Gradients of mean2d (2, N), covariance2d (3, N), logit (N,), colour (3, N), depth (N,); zero if not drawn."""
    d_mean2d, d_footprint, d_logit, d_colour, d_depth = gather_footprint_gradients(
        order, records, lists, pair_gradients, determinant, opacity_logit,
        conic_epsilon=conic_epsilon, keep_depth=keep_depth,
    )  # fmt: skip
    a, m, r = records[:, PRECISION], records[:, SLOPE], records[:, INVERSE_C]
    d_a, d_m, d_r = d_footprint[:, order]
    d_covariance2d = np.zeros_like(d_footprint)
    d_covariance2d[0, order] = -a * a * d_a
    d_covariance2d[1, order] = 2 * a * a * m * d_a + r * d_m
    d_covariance2d[2, order] = -a * a * m * m * d_a - m * r * d_m - r * r * d_r
    return d_mean2d, d_covariance2d, d_logit, d_colour, d_depth
