"""The two resampling steps of the Laplacian pyramid, row by row, and their exact adjoints.

Reduce: the separable binomial [1 4 6 4 1]/16 with border reflect-101 (the edge sample is not repeated), then
decimation to the even samples; n becomes ceil(n/2), for every n >= 1.

Expand, with coarse length m and fine length n = 2m or 2m - 1, edge samples repeated:
    fine[2k]     = even coarse[k] + (1 - even) coarse[k - 1]
    fine[2k + 1] = odd coarse[k] + (1 - odd) coarse[k + 1]
`co_sited`: even = 1, odd = 1/2 (coarse k coincides with fine 2k). `half_pixel`: even = odd = 3/4 (pixel edges
coincide). All weights are dyadic, so the same arithmetic on a mask is exact.

Fine rows are processed as pairs (m, 2) of an even and an odd sample, which keeps the inner loops free of strides.
`laplacian` builds its kernels from these row helpers; this module does not depend on losses.
"""

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for

Upsampling = Literal["co_sited", "half_pixel"]

# (even, odd): the weight of coarse sample k at fine samples 2k and 2k + 1
EXPAND_WEIGHTS: dict[str, tuple[float, float]] = {"co_sited": (1.0, 0.5), "half_pixel": (0.75, 0.75)}

BINOMIAL = (1 / 16, 4 / 16, 6 / 16, 4 / 16, 1 / 16)
MARGIN = 2  # taps of the binomial filter on either side
ROWS = 16  # rows in one partial sum of magnitudes


def expand_weights(upsampling: Upsampling) -> tuple[float, float]:
    """(even, odd) of an up-sampling rule. Raises ValueError for an unknown name."""
    if upsampling not in EXPAND_WEIGHTS:
        raise ValueError(f"upsampling {upsampling!r}; use one of {', '.join(EXPAND_WEIGHTS)}")
    return EXPAND_WEIGHTS[upsampling]


def coarse_length(n: int) -> int:
    """ceil(n / 2)"""
    return (n + 1) // 2


def _reflect(i, n):
    """Index i (any integer) folded into [0, n) by reflect-101; 0 for n = 1."""
    if n == 1:
        return 0
    period = 2 * (n - 1)
    i = abs(i) % period
    return period - i if i >= n else i


reflect = jit(_reflect)


def reflect_indices(n: int) -> list[NDArray[np.int64]]:
    """For each of the five taps, the fine index of every coarse sample of an axis of length n."""
    taps = range(-MARGIN, MARGIN + 1)
    return [np.array([_reflect(2 * k + o, n) for k in range(coarse_length(n))], np.int64) for o in taps]


def _reduce_row(fine, y, pairs, out):
    """out (m,) = row y of the reduced image; fine (h, w); pairs (m + 2, 2) scratch."""
    h, w = fine.shape
    m = out.size
    real = fine.dtype.type
    four, six, scale = real(4.0), real(6.0), real(1.0 / 256.0)
    padded = pairs.reshape(-1)
    a = fine[reflect(2 * y - 2, h)]
    b = fine[reflect(2 * y - 1, h)]
    c = fine[2 * y]
    d = fine[reflect(2 * y + 1, h)]
    e = fine[reflect(2 * y + 2, h)]
    inside = padded[MARGIN:]
    for x in range(w):
        inside[x] = (a[x] + e[x]) + four * (b[x] + d[x]) + six * c[x]
    padded[0] = inside[reflect(-2, w)]
    padded[1] = inside[reflect(-1, w)]
    for x in range(w, 2 * m + 2):
        inside[x] = inside[reflect(x, w)]
    following = pairs[1:]
    last = pairs[2:]
    for k in range(m):
        outer = pairs[k, 0] + last[k, 0]
        inner = pairs[k, 1] + following[k, 1]
        out[k] = (outer + four * inner + six * following[k, 0]) * scale


def _expand_row(coarse, y, even, odd, blend, pairs):
    """Fine row y of the expanded image into pairs (m, 2); coarse (mh, m); blend (m + 2,) scratch."""
    mh, m = coarse.shape
    real = coarse.dtype.type
    k = y >> 1
    own = coarse[k]
    if y & 1:
        other, weight = coarse[min(k + 1, mh - 1)], odd
    else:
        other, weight = coarse[max(k - 1, 0)], even
    rest = real(1.0) - weight
    centre = blend[1:]
    for x in range(m):
        centre[x] = weight * own[x] + rest * other[x]
    blend[0] = centre[0]
    centre[m] = centre[m - 1]
    after = blend[2:]
    even_rest, odd_rest = real(1.0) - even, real(1.0) - odd
    for x in range(m):
        pairs[x, 0] = even * centre[x] + even_rest * blend[x]
        pairs[x, 1] = odd * centre[x] + odd_rest * after[x]


def _gather_rows(source, starts, index, weight, y, target):
    """target = sum over the entries e of row y of weight[e] * source[index[e]]."""
    real = target.dtype.type
    for x in range(target.size):
        target[x] = real(0.0)
    for e in range(starts[y], starts[y + 1]):
        row = source[index[e]]
        factor = real(weight[e])
        for x in range(target.size):
            target[x] += factor * real(row[x])


def _reduce_row_adjoint(gathered, pairs, w):
    """Adjoint of the horizontal half of reduce; the fine row is then pairs.reshape(-1)[2 : 2 + w].

    gathered (m + 4,) coarse row with two zeros at either end; pairs (m + 2, 2) over the fine extent -2 ... 2m + 1.
    """
    real = gathered.dtype.type
    four, six, scale = real(4.0), real(6.0), real(1.0 / 16.0)
    own = gathered[1:]
    after = gathered[2:]
    for p in range(pairs.shape[0]):
        pairs[p, 0] = (gathered[p] + six * own[p] + after[p]) * scale
        pairs[p, 1] = (own[p] + after[p]) * four * scale
    padded = pairs.reshape(-1)
    inside = padded[MARGIN:]
    inside[reflect(-2, w)] += padded[0]
    inside[reflect(-1, w)] += padded[1]
    for x in range(w, inside.size):
        inside[reflect(x, w)] += inside[x]


def _expand_row_adjoint(pairs, even, odd, out):
    """Adjoint of the horizontal half of expand; out (m,).

    pairs (m + 2, 2) over the fine extent -2 ... 2m + 1, zero outside the fine row.
    """
    real = out.dtype.type
    even_rest, odd_rest = real(1.0) - even, real(1.0) - odd
    own = pairs[1:]
    after = pairs[2:]
    m = out.size
    for k in range(m):
        out[k] = (even * own[k, 0] + odd * own[k, 1]) + (even_rest * after[k, 0] + odd_rest * pairs[k, 1])
    out[0] += even_rest * own[0, 0]
    out[m - 1] += odd_rest * own[m - 1, 1]


class Table(NamedTuple):
    """Sparse transpose of a one-dimensional resampling: the source rows and weights of each target row."""

    starts: NDArray[np.int64]  # (targets + 1,)  entries of target y: starts[y] ... starts[y + 1]
    index: NDArray[np.int64]  # source row of every entry
    weight: NDArray[np.float64]


def _table(targets: int, entries: dict[tuple[int, int], float]) -> Table:
    """Entries {(target, source): weight}, zero weights dropped, ordered by target, then source."""
    kept = sorted((key, weight) for key, weight in entries.items() if weight != 0.0)
    owners = [key[0] for key, _ in kept]
    starts = np.searchsorted(owners, np.arange(targets + 1))
    index = np.array([key[1] for key, _ in kept], np.int64)
    return Table(starts.astype(np.int64), index, np.array([weight for _, weight in kept], np.float64))


@lru_cache(maxsize=64)
def reduce_adjoint_table(n: int) -> Table:
    """Fine row i <- coarse rows, for a fine length n."""
    entries: dict[tuple[int, int], float] = {}
    for k in range(coarse_length(n)):
        for offset, tap in zip(range(-MARGIN, MARGIN + 1), BINOMIAL):
            key = (_reflect(2 * k + offset, n), k)
            entries[key] = entries.get(key, 0.0) + tap
    return _table(n, entries)


def expand_parents(i: int, n: int, upsampling: Upsampling) -> list[tuple[int, float]]:
    """Coarse samples and nonzero weights that interpolate fine sample i of n."""
    even, odd = expand_weights(upsampling)
    k, m = i // 2, coarse_length(n)
    own, other = (even, max(k - 1, 0)) if i % 2 == 0 else (odd, min(k + 1, m - 1))
    return [(parent, weight) for parent, weight in ((k, own), (other, 1.0 - own)) if weight != 0.0]


@lru_cache(maxsize=64)
def expand_adjoint_table(n: int, upsampling: Upsampling) -> Table:
    """Coarse row k <- fine rows, for a fine length n."""
    entries: dict[tuple[int, int], float] = {}
    for i in range(n):
        for parent, weight in expand_parents(i, n, upsampling):
            entries[parent, i] = entries.get((parent, i), 0.0) + weight
    return _table(coarse_length(n), entries)


reduce_row = jit(_reduce_row)
expand_row = jit(_expand_row)
gather_rows = jit(_gather_rows)
reduce_row_adjoint = jit(_reduce_row_adjoint)
expand_row_adjoint = jit(_expand_row_adjoint)


def _reduce(first, stop, fine, out):
    mh, m = out.shape[1:]
    pairs = np.empty((m + 2, 2), fine.dtype)
    for index in range(first, stop):
        c, y = index // mh, index % mh
        reduce_row(fine[c], y, pairs, out[c, y])


def _expand(coarse, even, odd, out):
    channels, h, w = out.shape
    m = coarse.shape[2]
    pairs = np.empty((m, 2), coarse.dtype)
    blend = np.empty(m + 2, coarse.dtype)
    for c in range(channels):
        for y in range(h):
            expand_row(coarse[c], y, even, odd, blend, pairs)
            out[c, y] = pairs.reshape(-1)[:w]


_reduce_kernel = jit(_reduce)
_expand_kernel = jit(_expand)


def reduce_image(fine: FloatArray) -> FloatArray:
    """Binomial filter and decimation: (C, h, w) -> (C, ceil(h/2), ceil(w/2)), same dtype."""
    channels, h, w = fine.shape
    out = np.empty((channels, coarse_length(h), coarse_length(w)), fine.dtype)
    parallel_for(_reduce_kernel, channels * out.shape[1], np.ascontiguousarray(fine), out)
    return out


def expand_image(coarse: FloatArray, shape: tuple[int, int], upsampling: Upsampling = "co_sited") -> FloatArray:
    """Interpolation to the fine size: (C, ceil(h/2), ceil(w/2)) -> (C, h, w) with shape = (h, w), same dtype."""
    even, odd = (coarse.dtype.type(weight) for weight in expand_weights(upsampling))
    out = np.empty((coarse.shape[0], *shape), coarse.dtype)
    _expand_kernel(np.ascontiguousarray(coarse), even, odd, out)
    return out
