"""The lists of Gaussians that reach each tile, in depth order (B5, support and order).

Three steps: a pixel box for every Gaussian (its support), a stable sort by view depth with ties in index order, and a
counting sort of (tile, Gaussian) pairs. Every pair has one slot. The reverse pass writes the gradient of the pair
there, and a gather adds the slots of a Gaussian in tile order. No two threads write to the same cell, and the sum does
not depend on the number of threads.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray, IntArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.splatting.projection import Projected
from endotsr.method.splatting.settings import RasterSettings

CHUNKS = 16  # fixed: the lists must not depend on the number of threads
LEGACY_TILE = 16
_RADIX_BITS = 11

_EVERYWHERE, _ELLIPSE, _THREE_SIGMA_TILES = 0, 1, 2
_SUPPORT_CODE = {"everywhere": _EVERYWHERE, "ellipse": _ELLIPSE, "three_sigma_tiles": _THREE_SIGMA_TILES}


class TileLists(NamedTuple):
    """Tiles in row-major order; each lists the depth ranks of its Gaussians, nearest first."""

    starts: IntArray  # (tiles + 1,) range of each tile in `ranks`
    ranks: IntArray  # (pairs,) int32 depth rank
    pair_starts: IntArray  # (n + 1,) range of each depth rank in `slots`
    slots: IntArray  # (pairs,) position of the pair in `ranks`, in tile order


def _boxes(
    first, stop, mean2d, covariance2d, determinant, log_opacity, visible, support, log_cutoff, width, height, box
):
    """Inclusive pixel box x0, x1, y0, y1 of each Gaussian; clears `visible` when the box is empty.

    The ellipse box is the exact extent of alpha >= cutoff plus a margin far above rounding, so it loses no pixel.
    """
    real = mean2d.dtype.type
    half, one, two, three, zero, tenth = real(0.5), real(1), real(2), real(3), real(0), real(0.1)
    margin, right, bottom = real(1e-3), real(width - 1), real(height - 1)
    for i in range(first, stop):
        if not visible[i]:
            continue
        x, y = mean2d[0, i], mean2d[1, i]
        a, c = covariance2d[0, i], covariance2d[2, i]
        if support == _EVERYWHERE:
            box[i, 0], box[i, 1], box[i, 2], box[i, 3] = 0, width - 1, 0, height - 1
            continue
        if support == _ELLIPSE:
            reach = two * (log_opacity[i] - log_cutoff)
            if not reach >= zero:  # too faint, or not a number
                visible[i] = False
                continue
            ex, ey = math.sqrt(reach * a), math.sqrt(reach * c)
            ex += (ex + abs(x)) * real(1e-5) + margin
            ey += (ey + abs(y)) * real(1e-5) + margin
            # clip in floating point before the conversion to int: a huge splat must not overflow
            x0, x1 = math.ceil(max(x - ex - half, zero)), math.floor(min(x + ex - half, right))
            y0, y1 = math.ceil(max(y - ey - half, zero)), math.floor(min(y + ey - half, bottom))
        else:
            middle = half * (a + c)
            radius = math.ceil(three * math.sqrt(middle + math.sqrt(max(tenth, middle * middle - determinant[i]))))
            tile = real(LEGACY_TILE)
            limit_x, limit_y = right + tile, bottom + tile
            # the CUDA rasterisers truncate toward zero, in integer-pixel coordinates (mean - 1/2)
            x0 = tile * math.floor(min(max((x - half - radius) / tile, zero), limit_x))
            x1 = tile * math.floor(min(max((x - half + radius + tile - one) / tile, zero), limit_x)) - one
            y0 = tile * math.floor(min(max((y - half - radius) / tile, zero), limit_y))
            y1 = tile * math.floor(min(max((y - half + radius + tile - one) / tile, zero), limit_y)) - one
            x1, y1 = min(x1, right), min(y1, bottom)
        if x0 > x1 or y0 > y1:
            visible[i] = False
            continue
        box[i, 0], box[i, 1], box[i, 2], box[i, 3] = int(x0), int(x1), int(y0), int(y1)


def _radix_order(key, visible):
    """Indices of the visible entries by ascending unsigned key, stable (least significant digit first)."""
    count = 0
    for i in range(key.size):
        if visible[i]:
            count += 1
    keys, index = np.empty(count, key.dtype), np.empty(count, np.int32)
    keys_next, index_next = np.empty(count, key.dtype), np.empty(count, np.int32)
    m = 0
    for i in range(key.size):
        if visible[i]:
            keys[m], index[m] = key[i], i
            m += 1
    mask = np.uint64((1 << _RADIX_BITS) - 1)
    histogram = np.empty(1 << _RADIX_BITS, np.int64)
    for shift in range(0, 8 * key.itemsize, _RADIX_BITS):
        histogram[:] = 0
        for i in range(count):
            histogram[np.int64((np.uint64(keys[i]) >> np.uint64(shift)) & mask)] += 1
        total = 0
        for d in range(histogram.size):
            here = histogram[d]
            histogram[d] = total
            total += here
        for i in range(count):
            d = np.int64((np.uint64(keys[i]) >> np.uint64(shift)) & mask)
            at = histogram[d]
            histogram[d] = at + 1
            keys_next[at], index_next[at] = keys[i], index[i]
        keys, keys_next = keys_next, keys
        index, index_next = index_next, index
    return index


# The counting sort of (tile, Gaussian) pairs runs over CHUNKS independent chunks of the depth order.


def _count_pairs(first, last, box, order, tile_width, tile_height, tiles_x, tile_box, counts, pair_starts):
    """First and last tile column and row of each Gaussian; pairs of each (chunk, tile), and of each Gaussian at the
    next entry of `pair_starts`.

    A division costs as much as everything else, so each is computed once, here. It is unsigned: boxes are inside the
    image.
    """
    n = order.size
    w, h = np.uint32(tile_width), np.uint32(tile_height)
    for chunk in range(first, last):
        mine = counts[chunk]
        for k in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            i, tiles = order[k], tile_box[k]
            tx0, tx1 = np.int64(np.uint32(box[i, 0]) // w), np.int64(np.uint32(box[i, 1]) // w)
            ty0, ty1 = np.int64(np.uint32(box[i, 2]) // h), np.int64(np.uint32(box[i, 3]) // h)
            tiles[0], tiles[1], tiles[2], tiles[3] = tx0, tx1, ty0, ty1
            pair_starts[k + 1] = (tx1 - tx0 + 1) * (ty1 - ty0 + 1)
            for ty in range(ty0, ty1 + 1):
                for tx in range(tx0, tx1 + 1):
                    mine[ty * tiles_x + tx] += 1


def _tile_starts(counts, starts, pair_starts):
    """Running sums: the start of each tile, of each (chunk, tile) (in `counts`), and of each Gaussian."""
    total = 0
    for t in range(starts.size - 1):
        starts[t] = total
        for chunk in range(CHUNKS):
            here = counts[chunk, t]
            counts[chunk, t] = total
            total += here
    starts[starts.size - 1] = total
    for k in range(pair_starts.size - 1):
        pair_starts[k + 1] += pair_starts[k]


def _fill_lists(first, last, tile_box, tiles_x, counts, pair_starts, ranks, slots):
    """Write every pair to its position; `counts` is the next free position of each (chunk, tile)."""
    n = tile_box.shape[0]
    for chunk in range(first, last):
        position = counts[chunk]
        for k in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            tiles, at = tile_box[k], pair_starts[k]
            for ty in range(tiles[2], tiles[3] + 1):
                for tx in range(tiles[0], tiles[1] + 1):
                    t = ty * tiles_x + tx
                    place = position[t]
                    ranks[place], slots[at] = k, place
                    position[t] = place + 1
                    at += 1


_boxes_kernel = jit(_boxes)
_radix_kernel = jit(_radix_order)
_count_kernel = jit(_count_pairs)
_starts_kernel = jit(_tile_starts)
_fill_kernel = jit(_fill_lists)


def screen_boxes(
    projected: Projected, log_opacity: FloatArray, settings: RasterSettings, width: int, height: int
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Pixel boxes (N, 4) x0, x1, y0, y1 inclusive, and whose box contains a pixel of the image (N,).

    log_opacity  (N,) natural log of the opacity
    Edges:       without an alpha cutoff the ellipse is unbounded: every visible Gaussian reaches every pixel
    """
    support = settings.support if settings.alpha_cutoff > 0 or settings.support != "ellipse" else "everywhere"
    box = np.zeros((projected.depth.size, 4), np.int32)
    visible = projected.visible.copy()
    log_cutoff = projected.depth.dtype.type(math.log(settings.alpha_cutoff) if settings.alpha_cutoff > 0 else 0.0)
    parallel_for(
        _boxes_kernel, visible.size,
        projected.mean2d, projected.covariance2d, projected.determinant, log_opacity, visible,
        _SUPPORT_CODE[support], log_cutoff, width, height, box,
    )  # fmt: skip
    return box, visible


def depth_order(depth: FloatArray, visible: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Indices of the visible Gaussians, nearest first, ties in index order. Depth must be > 0 where visible.

    The bit pattern of a positive float increases with its value, so an integer radix sort is exact.
    """
    return _radix_kernel(depth.view(np.uint32 if depth.dtype == np.float32 else np.uint64), visible)


def tile_lists(
    box: NDArray[np.int32], order: NDArray[np.int32], tile_width: int, tile_height: int, width: int, height: int
) -> TileLists:
    """Depth-ordered lists of the Gaussians whose box touches each tile."""
    tiles_x, tiles_y = -(-width // tile_width), -(-height // tile_height)
    n = order.size
    counts, pair_starts = np.zeros((CHUNKS, tiles_x * tiles_y), np.int64), np.zeros(n + 1, np.int64)
    tile_box = np.empty((n, 4), np.int32)  # first and last tile column and row, in depth order
    parallel_for(_count_kernel, CHUNKS, box, order, tile_width, tile_height, tiles_x, tile_box, counts, pair_starts)
    starts = np.empty(tiles_x * tiles_y + 1, np.int64)
    _starts_kernel(counts, starts, pair_starts)
    ranks, slots = np.empty(starts[-1], np.int32), np.empty(starts[-1], np.int32)
    parallel_for(_fill_kernel, CHUNKS, tile_box, tiles_x, counts, pair_starts, ranks, slots)
    return TileLists(starts, ranks, pair_starts, slots)
