"""Front-to-back compositing of colour, depth and opacity: the definition, for every setting (B5).

Per pixel, nearest first: alpha_i = min(alpha_max, opacity exp(-q/2)). An alpha below the cutoff contributes nothing,
and the pixel is finished before T falls below the stop. colour = sum c_i alpha_i T_i + T background,
depth = sum z_i alpha_i T_i, opacity = sum alpha_i T_i.

The reverse pass stores T_i and iterates back to front with R_i = alpha_i c_i + (1 - alpha_i) R_{i+1}. It never divides
by T or 1 - alpha, so it is exact for alpha = 1 and behind opaque stacks. `fast.blocks` computes the same for the
`paper` preset, many pixels at a time.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.elementary import exponential
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.splatting.binning import TileLists
from endotsr.method.splatting.records import (
    BLUE,
    DEPTH,
    GRADIENT,
    GREEN,
    INVERSE_C,
    OPACITY,
    PRECISION,
    RED,
    SLOPE,
    SUM_BLUE,
    SUM_DEPTH,
    SUM_GREEN,
    SUM_RED,
    SUM_S,
    SUM_SE,
    SUM_SEE,
    SUM_SEY,
    SUM_SY,
    SUM_SYY,
    U,
    V,
)
from endotsr.method.splatting.settings import RasterSettings

TILE_WIDTH = 16
TILE_HEIGHT = 16


class Composite(NamedTuple):
    """Images of one view."""

    colour: FloatArray  # (3, H, W) background included, no upper clamp
    depth: FloatArray  # (H, W) sum of z alpha T, scene units, not normalised
    opacity: FloatArray  # (H, W) sum of alpha T, 0..1
    transmittance: FloatArray  # (H, W) final T


class CompositeSaved(NamedTuple):
    """Inputs and images, for the reverse pass."""

    records: FloatArray
    lists: TileLists
    limits: FloatArray
    background: FloatArray
    pass_clamped_alpha: bool
    out: Composite


def empty_composite(width: int, height: int, dtype) -> Composite:
    """Images of this size, not initialised."""
    plane = (height, width)
    return Composite(np.empty((3, *plane), dtype), *(np.empty(plane, dtype) for _ in range(3)))


def composite_limits(settings: RasterSettings, dtype) -> FloatArray:
    """alpha cutoff, transmittance stop, alpha max in the dtype of the run."""
    return np.array([settings.alpha_cutoff, settings.transmittance_stop, settings.alpha_max], dtype)


def _alpha(record, x, y):
    """e, dy and opacity exp(-q/2) of one Gaussian at one sample position."""
    dy = y - record[V]
    e = (x - record[U]) - record[SLOPE] * dy
    q = record[INVERSE_C] * dy * dy + record[PRECISION] * e * e
    half = type(q)(0.5)
    return e, dy, record[OPACITY] * exponential(-half * q)


_alpha_kernel = jit(_alpha)


def _composite(
    first_tile, last_tile, records, starts, ranks, limits, background, colour, depth, opacity, transmittance
):
    real = records.dtype.type
    one, zero, half = real(1), real(0), real(0.5)
    cutoff, stop, alpha_max = limits[0], limits[1], limits[2]
    height, width = depth.shape
    tiles_x = (width + TILE_WIDTH - 1) // TILE_WIDTH
    for tile in range(first_tile, last_tile):
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        for row in range(top, min(height, top + TILE_HEIGHT)):
            for column in range(left, min(width, left + TILE_WIDTH)):
                x, y = real(column) + half, real(row) + half
                t, red, green, blue, z, total = one, zero, zero, zero, zero, zero
                for p in range(starts[tile], starts[tile + 1]):
                    record = records[ranks[p]]
                    _, _, value = _alpha_kernel(record, x, y)
                    alpha = min(value, alpha_max)
                    if alpha < cutoff:
                        continue
                    behind = t * (one - alpha)
                    if behind < stop:
                        break
                    weight = alpha * t
                    red += weight * record[RED]
                    green += weight * record[GREEN]
                    blue += weight * record[BLUE]
                    z += weight * record[DEPTH]
                    total += weight
                    t = behind
                colour[0, row, column] = red + t * background[0]
                colour[1, row, column] = green + t * background[1]
                colour[2, row, column] = blue + t * background[2]
                depth[row, column], opacity[row, column], transmittance[row, column] = z, total, t


def _pixel_reverse(records, ranks, hit, kept, pixel, rest, sums):
    """Add the gradients of the blended pairs of a pixel to their sums, from last to first.

    hit, kept   pairs that were blended, nearest first; alpha, T, e, dy and the alpha that passes the clamp
    pixel       dL/d(red, green, blue, depth, opacity)
    rest        <g, R> behind the last pair
    """
    one = records.dtype.type(1)
    g0, g1, g2, gz, go = pixel
    for j in range(hit.size - 1, -1, -1):
        record = records[ranks[hit[j]]]
        alpha, t, e, dy = kept[j, 0], kept[j, 1], kept[j, 2], kept[j, 3]
        own = g0 * record[RED] + g1 * record[GREEN] + g2 * record[BLUE] + gz * record[DEPTH] + go
        s = kept[j, 4] * (t * (own - rest))
        rest = alpha * own + (one - alpha) * rest
        weight = alpha * t
        out = sums[hit[j]]
        out[SUM_S] += s
        out[SUM_SE] += s * e
        out[SUM_SY] += s * dy
        out[SUM_SEE] += s * e * e
        out[SUM_SEY] += s * e * dy
        out[SUM_SYY] += s * dy * dy
        out[SUM_RED] += weight * g0
        out[SUM_GREEN] += weight * g1
        out[SUM_BLUE] += weight * g2
        out[SUM_DEPTH] += weight * gz


_pixel_reverse_kernel = jit(_pixel_reverse)


def _composite_reverse(
    first_tile,
    last_tile,
    records,
    starts,
    ranks,
    limits,
    background,
    pass_clamped,
    d_colour,
    d_depth,
    d_opacity,
    pair_gradients,
):
    real = records.dtype.type
    one, zero, half = real(1), real(0), real(0.5)
    cutoff, stop, alpha_max = limits[0], limits[1], limits[2]
    height, width = d_depth.shape
    tiles_x = (width + TILE_WIDTH - 1) // TILE_WIDTH
    for tile in range(first_tile, last_tile):
        first, length = starts[tile], starts[tile + 1] - starts[tile]
        end = first + length
        pair_gradients[first:end] = zero
        hit = np.empty(length, np.int64)  # pairs that were blended, nearest first
        kept = np.empty((length, 5), records.dtype)  # alpha, T, e, dy, and the factor of dL/dalpha below
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        for row in range(top, min(height, top + TILE_HEIGHT)):
            for column in range(left, min(width, left + TILE_WIDTH)):
                x, y = real(column) + half, real(row) + half
                t, n = one, 0
                for p in range(length):
                    e, dy, value = _alpha_kernel(records[ranks[first + p]], x, y)
                    alpha = min(value, alpha_max)
                    if alpha < cutoff:
                        continue
                    behind = t * (one - alpha)
                    if behind < stop:
                        break
                    kept[n, 0], kept[n, 1], kept[n, 2], kept[n, 3] = alpha, t, e, dy
                    # the alpha that multiplies dL/dalpha: zero if clamped, unless the deviation passes the clamp
                    kept[n, 4] = zero if value > alpha_max and not pass_clamped else value
                    hit[n] = p
                    n += 1
                    t = behind
                g0, g1, g2 = d_colour[0, row, column], d_colour[1, row, column], d_colour[2, row, column]
                gz, go = d_depth[row, column], d_opacity[row, column]
                rest = g0 * background[0] + g1 * background[1] + g2 * background[2]  # <g, R> behind the pair
                pixel = g0, g1, g2, gz, go
                _pixel_reverse_kernel(records, ranks[first:end], hit[:n], kept, pixel, rest, pair_gradients[first:end])


_composite_kernel = jit(_composite)
_composite_reverse_kernel = jit(_composite_reverse)


def composite_forward(
    records: FloatArray,
    lists: TileLists,
    settings: RasterSettings,
    background: FloatArray,
    width: int,
    height: int,
) -> tuple[Composite, CompositeSaved]:
    """Blend records into images; 16x16 tiles (specification B5).

    records     (n, 11) from `pack_records`, nearest first
    lists       tiles of 16x16 pixels
    background  (3,) colour behind everything
    returns     Composite

    Reverse: `composite_reverse`.
    Edges:   n = 0 gives the background. alpha = 1 ends a pixel: with T = 0 if the stop is 0; with a stop above 0, the
             pixel ends before this Gaussian, which is not blended.
    Oracle:  `endotsr.definition.compositing`.
    """
    dtype = records.dtype
    out = empty_composite(width, height, dtype)
    limits = composite_limits(settings, dtype)
    parallel_for(_composite_kernel, lists.starts.size - 1, records, lists.starts, lists.ranks, limits, background, *out)
    return out, CompositeSaved(records, lists, limits, background, settings.deviations.pass_clamped_alpha, out)


def composite_reverse(
    d_colour: FloatArray, d_depth: FloatArray, d_opacity: FloatArray, saved: CompositeSaved
) -> FloatArray:
    """Pair gradients (pairs, 10) from dL/dcolour (3, H, W), dL/ddepth (H, W), dL/dopacity (H, W)."""
    pair_gradients = np.empty((saved.lists.ranks.size, GRADIENT), saved.records.dtype)
    parallel_for(
        _composite_reverse_kernel, saved.lists.starts.size - 1,
        saved.records, saved.lists.starts, saved.lists.ranks, saved.limits, saved.background,
        saved.pass_clamped_alpha, d_colour, d_depth, d_opacity, pair_gradients,
    )  # fmt: skip
    return pair_gradients


def background_gradient(d_colour: FloatArray, transmittance: FloatArray) -> FloatArray:
    """dL/dbackground (3,): sum over pixels of dL/dcolour times the final T."""
    return np.einsum("chw,hw->c", d_colour, transmittance)
