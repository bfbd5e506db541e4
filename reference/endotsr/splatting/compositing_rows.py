"""The fast path of compositing: the same sums as `compositing`, sixteen pixels of a row at a time.

Used where the alpha cutoff bounds each Gaussian and alpha_max < 1 (the `paper` preset). Reasons, in order of gain:

* A Gaussian visits only the rows of its ellipse alpha >= cutoff, and in a row only its span, in chunks of
  LANES pixels. The span is widened beyond rounding and every lane tests alpha >= cutoff itself, so the
  result is bitwise that of visiting every pixel.
* The planes of a tile (T, red, green, blue, depth) stand in one flat buffer at constant offsets and are
  indexed with unsigned integers: no alias or wrap-around checks, so the lane loop becomes vector code.
* The records of a batch of pairs are copied together before they are used: depth order is random order in
  memory, and waits for memory overlap only while nothing depends on them.
* log2(opacity) and log2(e) are folded into the exponent: alpha is a bare 2^x.
* The sign of T marks a finished pixel; selects, no branches, in the lane loop.
* The reverse pass replays front to back: what lies behind a pair is <g, image> minus the running sum, one
  number per pixel, no stored lists. It divides by 1 - alpha >= 1 - alpha_max; the error this
  costs against the R_i recursion is bounded in tests/splatting.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.jit import jit, jit_inline
from endotsr.sharing import share
from endotsr.splatting.binning import TileLists
from endotsr.splatting.compositing import Composite, composite_limits, empty_composite
from endotsr.splatting.exponential import LOG2_E, exp2_nonpositive
from endotsr.splatting.records import (
    BLUE,
    DEPTH,
    GRADIENT,
    GREEN,
    HALF_HEIGHT,
    INVERSE_C,
    LOG2_OPACITY,
    PRECISION,
    RECORD,
    RED,
    SLOPE,
    U,
    V,
)
from endotsr.splatting.settings import RasterSettings

FloatArray = NDArray[np.floating]

TILE_WIDTH = 32
TILE_HEIGHT = 16
LANES = 16
PITCH = TILE_WIDTH + LANES  # a chunk may start at the last column: the rest of it lands in the padding
PLANE = PITCH * TILE_HEIGHT + LANES  # not a multiple of 4 KiB between any two planes: they would share cache sets
BATCH = 32  # pairs fetched at once; before each batch comes the test whether the whole tile is finished

_U64 = np.uint64


class RowsSaved(NamedTuple):
    """What the reverse pass needs."""

    records: FloatArray
    lists: TileLists
    limits: FloatArray
    out: Composite


def supports(settings: RasterSettings) -> bool:
    """Whether this path computes these settings: bounded support, alpha_max < 1, exact gradient at the clamp."""
    return (
        settings.support == "ellipse"
        and settings.alpha_cutoff > 0
        and settings.alpha_max < 1
        and not settings.deviations.pass_clamped_alpha
    )


def _rows(record, top):
    """First and last tile row (inclusive) whose samples the ellipse may reach; margin beyond rounding."""
    real = record.dtype.type
    half, zero = real(0.5), real(0)
    reach = record[HALF_HEIGHT]
    reach += (reach + abs(record[V])) * real(1e-5) + real(1e-3)
    low = max(record[V] - reach - half - real(top), zero)
    high = min(record[V] + reach - half - real(top), real(TILE_HEIGHT - 1))
    first = np.int32(low)  # library calls for ceil and floor would cost more than the rest
    first += np.int32(real(first) < low)
    return first, np.int32(high) if high >= zero else np.int32(-1)


def _spans(record, top, left, log2_cutoff, lines):
    """Of all rows of a tile at once (vector code): dy, exponent and shift of the centre line, and the columns to visit.

    lines  (5 TILE_HEIGHT,) filled with dy, log2 alpha on the centre line, shift m dy, first and last tile column
           (first > last where the row is not reached)

    The half-width of a row is sqrt(2 ln 2 reach / A), reach = log2(alpha / cutoff) on its centre line, plus a margin
    beyond rounding, so that no pixel with alpha >= cutoff is missed; a column too many does no harm. Where a huge
    footprint just reaches a row, the reach is a difference of nearly equal numbers: `faintest` allows for its rounding.
    """
    real = record.dtype.type
    half, one, zero = real(0.5), real(1), real(0)
    u, v, slope, log2_opacity = record[U], record[V], record[SLOPE], record[LOG2_OPACITY]
    r2 = half * real(LOG2_E) * record[INVERSE_C]
    spread, margin = one / (half * real(LOG2_E) * record[PRECISION]), abs(u) * real(1e-5) + real(1e-3)
    faintest = log2_cutoff - (one - log2_cutoff) * real(1e-6)
    first_row, right = real(top) + half - v, real(TILE_WIDTH - 1)
    offset = u - half - real(left)
    for y in range(TILE_HEIGHT):
        k = _U64(y)
        dy = first_row + real(y)
        exponent = log2_opacity - r2 * dy * dy
        shift = slope * dy
        width = math.sqrt(max(spread * (exponent - faintest), zero)) + margin
        low, high = offset + shift - width, min(offset + shift + width, right)
        lines[k] = dy
        lines[k + _U64(TILE_HEIGHT)] = exponent
        lines[k + _U64(2 * TILE_HEIGHT)] = shift
        lines[k + _U64(3 * TILE_HEIGHT)] = min(max(low, zero), real(TILE_WIDTH))
        lines[k + _U64(4 * TILE_HEIGHT)] = high if high >= zero else -one


def _line(lines, y):
    """Row y of what `_spans` filled: dy, exponent, shift, first and last column."""
    k = _U64(y)
    dy, exponent, shift = lines[k], lines[k + _U64(TILE_HEIGHT)], lines[k + _U64(2 * TILE_HEIGHT)]
    return dy, exponent, shift, np.int32(lines[k + _U64(3 * TILE_HEIGHT)]), np.int32(lines[k + _U64(4 * TILE_HEIGHT)])


_rows_kernel = jit_inline(_rows)
_spans_kernel = jit_inline(_spans)
_line_kernel = jit_inline(_line)


def _finished(buffer):
    """Whether no pixel of the tile can take another pair: every T is zero or marked negative."""
    zero = buffer.dtype.type(0)
    alive = np.int32(0)
    for j in range(PLANE):
        alive += np.int32(buffer[_U64(j)] > zero)
    return alive == 0


_finished_kernel = jit(_finished, contract=True)


def _fetch(records, ranks, start, stop, batch):
    """Copy the records of pairs start ... stop - 1: one by one, each would be waited for alone."""
    for p in range(start, stop):
        record, copy = records[ranks[p]], batch[p - start]
        for j in range(RECORD):
            copy[_U64(j)] = record[_U64(j)]


_fetch_kernel = jit_inline(_fetch)


def _blend_row(buffer, base, e0, a2, row2, record, log2_cutoff, stop, alpha_max):
    """Blend one Gaussian into LANES pixels of one row."""
    real = buffer.dtype.type
    zero = real(0)
    red, green, blue, depth = record[RED], record[GREEN], record[BLUE], record[DEPTH]
    for lane in range(LANES):
        j = base + _U64(lane)
        e = e0 + real(lane)
        exponent = row2 - a2 * e * e
        alpha = min(exp2_nonpositive(exponent), alpha_max)
        t = buffer[j]
        live = max(t, zero)
        weight = alpha * live if exponent >= log2_cutoff else zero
        behind = live - weight
        go = behind >= stop
        weight = weight if go else zero
        buffer[j] = behind if go else -abs(t)
        buffer[j + _U64(PLANE)] += weight * red
        buffer[j + _U64(2 * PLANE)] += weight * green
        buffer[j + _U64(3 * PLANE)] += weight * blue
        buffer[j + _U64(4 * PLANE)] += weight * depth


_blend_row_kernel = jit_inline(_blend_row)


def _write_row(buffer, t_at, at, factor, out):
    """One row of a plane, plus what shines through: out = plane + T factor."""
    for x in range(out.size):
        k = _U64(x)
        out[k] = buffer[at + k] + abs(buffer[t_at + k]) * factor


_write_row_kernel = jit(_write_row, contract=True)


def _write_tile(buffer, top, left, background, colour, depth, opacity, transmittance):
    """The finished tile to the images; row by row and plane by plane, which is vector code."""
    zero, one = buffer.dtype.type(0), buffer.dtype.type(1)
    right = min(left + TILE_WIDTH, depth.shape[1])
    for y in range(top, min(top + TILE_HEIGHT, depth.shape[0])):
        at = _U64((y - top) * PITCH)
        for channel in range(3):
            plane = at + _U64((channel + 1) * PLANE)
            _write_row_kernel(buffer, at, plane, background[channel], colour[channel, y, left:right])
        _write_row_kernel(buffer, at, at + _U64(4 * PLANE), zero, depth[y, left:right])
        t_row, opacity_row = transmittance[y, left:right], opacity[y, left:right]
        for x in range(t_row.size):
            t_row[x] = abs(buffer[at + _U64(x)])
        for x in range(t_row.size):
            opacity_row[x] = one - t_row[x]


_write_tile_kernel = jit(_write_tile, contract=True)


def _blend(first_tile, last_tile, records, starts, ranks, limits, background, colour, depth, opacity, transmittance):
    real = records.dtype.type
    half, one = real(0.5), real(1)
    stop, alpha_max = limits[1], limits[2]
    log2_cutoff = real(math.log2(limits[0]))
    tiles_x = (depth.shape[1] + TILE_WIDTH - 1) // TILE_WIDTH
    for tile in range(first_tile, last_tile):
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        buffer = np.zeros(5 * PLANE, records.dtype)
        lines = np.empty(5 * TILE_HEIGHT, records.dtype)
        batch = np.empty((BATCH, RECORD), records.dtype)
        for y in range(TILE_HEIGHT):
            for x in range(TILE_WIDTH):
                buffer[y * PITCH + x] = one
        for p in range(starts[tile], starts[tile + 1]):
            k = (p - starts[tile]) % BATCH
            if k == 0:
                if _finished_kernel(buffer):
                    break
                _fetch_kernel(records, ranks, p, min(p + BATCH, starts[tile + 1]), batch)
            record = batch[k]
            first, last = _rows_kernel(record, top)
            _spans_kernel(record, top, left, log2_cutoff, lines)
            a2 = half * real(LOG2_E) * record[PRECISION]
            for y in range(first, last + np.int32(1)):
                _, row2, shift, low, high = _line_kernel(lines, y)
                for x in range(low, high + 1, LANES):
                    _blend_row_kernel(
                        buffer, _U64(y * PITCH + x), real(left + x) + half - record[U] - shift, a2, row2,
                        record, log2_cutoff, stop, alpha_max,
                    )  # fmt: skip
        _write_tile_kernel(buffer, top, left, background, colour, depth, opacity, transmittance)


def _blend_row_reverse(buffer, sums, base, e0, dy, a2, row2, record, log2_cutoff, stop, alpha_max):
    """Replay one Gaussian over LANES pixels: planes T, behind, g_red, g_green, g_blue, g_depth."""
    real = buffer.dtype.type
    zero, one = real(0), real(1)
    red, green, blue, depth = record[RED], record[GREEN], record[BLUE], record[DEPTH]
    for lane in range(LANES):
        j, k = base + _U64(lane), _U64(lane)
        e = e0 + real(lane)
        exponent = row2 - a2 * e * e
        value = exp2_nonpositive(exponent)
        alpha = min(value, alpha_max)
        t = buffer[j]
        live = max(t, zero)
        weight = alpha * live if exponent >= log2_cutoff else zero
        after = live - weight
        go = after >= stop
        weight = weight if go else zero
        buffer[j] = after if go else -abs(t)
        g0, g1 = buffer[j + _U64(2 * PLANE)], buffer[j + _U64(3 * PLANE)]
        g2, gz = buffer[j + _U64(4 * PLANE)], buffer[j + _U64(5 * PLANE)]
        own = weight * (g0 * red + g1 * green + g2 * blue + gz * depth)
        behind = buffer[j + _U64(PLANE)] - own
        buffer[j + _U64(PLANE)] = behind
        passes = (weight > zero) & (value <= alpha_max)
        s = own - behind * alpha / (one - alpha) if passes else zero
        se, sy = s * e, s * dy
        sums[k] += s
        sums[k + _U64(LANES)] += se
        sums[k + _U64(2 * LANES)] += sy
        sums[k + _U64(3 * LANES)] += se * e
        sums[k + _U64(4 * LANES)] += se * dy
        sums[k + _U64(5 * LANES)] += sy * dy
        sums[k + _U64(6 * LANES)] += weight * g0
        sums[k + _U64(7 * LANES)] += weight * g1
        sums[k + _U64(8 * LANES)] += weight * g2
        sums[k + _U64(9 * LANES)] += weight * gz


_blend_row_reverse_kernel = jit_inline(_blend_row_reverse)


def _fold_lanes(sums, out):
    """Add the lanes of each sum in halves: the same order always, and vector adds."""
    for j in range(GRADIENT):
        base = _U64(j * LANES)
        for lane in range(LANES // 2):
            sums[base + _U64(lane)] += sums[base + _U64(lane + LANES // 2)]
        for lane in range(LANES // 4):
            sums[base + _U64(lane)] += sums[base + _U64(lane + LANES // 4)]
        out[_U64(j)] = (sums[base] + sums[base + _U64(2)]) + (sums[base + _U64(1)] + sums[base + _U64(3)])


_fold_lanes_kernel = jit_inline(_fold_lanes)


def _read_row(buffer, total_at, at, gradient, image):
    """One row of an image gradient g to its plane, and g image to the running total of the pixel."""
    for x in range(gradient.size):
        k = _U64(x)
        buffer[at + k] = gradient[k]
        buffer[total_at + k] += gradient[k] * image[k]


_read_row_kernel = jit(_read_row, contract=True)


def _read_tile(buffer, top, left, colour, depth, transmittance, d_colour, d_depth, d_opacity):
    """Planes T = 1, behind = <g, image>, g; the buffer comes filled with 0."""
    one = buffer.dtype.type(1)
    right = min(left + TILE_WIDTH, depth.shape[1])
    for y in range(top, min(top + TILE_HEIGHT, depth.shape[0])):
        at = _U64((y - top) * PITCH)
        behind = at + _U64(PLANE)
        for x in range(right - left):
            buffer[at + _U64(x)] = one
        for channel in range(3):
            plane = at + _U64((2 + channel) * PLANE)
            _read_row_kernel(buffer, behind, plane, d_colour[channel, y, left:right], colour[channel, y, left:right])
        _read_row_kernel(buffer, behind, at + _U64(5 * PLANE), d_depth[y, left:right], depth[y, left:right])
        if d_opacity.shape[0] > 0:  # opacity = 1 - T acts like a background of colour -1
            for x in range(right - left):
                buffer[behind + _U64(x)] -= d_opacity[y, left + x] * transmittance[y, left + x]


_read_tile_kernel = jit(_read_tile, contract=True)


def _blend_reverse(
    first_tile, last_tile,
    records, starts, ranks, limits, colour, depth, transmittance, d_colour, d_depth, d_opacity,
    pair_gradients,
):  # fmt: skip
    """`d_opacity` has no rows when nothing depends on the opacity image."""
    real = records.dtype.type
    half, zero = real(0.5), real(0)
    stop, alpha_max = limits[1], limits[2]
    log2_cutoff = real(math.log2(limits[0]))
    tiles_x = (depth.shape[1] + TILE_WIDTH - 1) // TILE_WIDTH
    for tile in range(first_tile, last_tile):
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        buffer = np.zeros(6 * PLANE, records.dtype)
        sums = np.zeros(GRADIENT * LANES, records.dtype)
        lines = np.empty(5 * TILE_HEIGHT, records.dtype)
        batch = np.empty((BATCH, RECORD), records.dtype)
        _read_tile_kernel(buffer, top, left, colour, depth, transmittance, d_colour, d_depth, d_opacity)
        done = False
        for p in range(starts[tile], starts[tile + 1]):
            k = (p - starts[tile]) % BATCH
            if k == 0 and not done:
                done = _finished_kernel(buffer)
                _fetch_kernel(records, ranks, p, min(p + BATCH, starts[tile + 1]), batch)
            out = pair_gradients[p]
            if done:
                for j in range(GRADIENT):
                    out[j] = zero
                continue
            record = batch[k]
            for j in range(GRADIENT * LANES):
                sums[_U64(j)] = zero
            first, last = _rows_kernel(record, top)
            _spans_kernel(record, top, left, log2_cutoff, lines)
            a2 = half * real(LOG2_E) * record[PRECISION]
            for y in range(first, last + np.int32(1)):
                dy, row2, shift, low, high = _line_kernel(lines, y)
                for x in range(low, high + 1, LANES):
                    _blend_row_reverse_kernel(
                        buffer, sums, _U64(y * PITCH + x), real(left + x) + half - record[U] - shift, dy,
                        a2, row2, record, log2_cutoff, stop, alpha_max,
                    )  # fmt: skip
            _fold_lanes_kernel(sums, out)


_blend_kernel = jit(_blend, contract=True)
_blend_reverse_kernel = jit(_blend_reverse, contract=True)


def composite_rows_forward(
    records: FloatArray, lists: TileLists, settings: RasterSettings, background: FloatArray, width: int, height: int
) -> tuple[Composite, RowsSaved]:
    """As `composite_forward`, on tiles of 32x16 pixels; the opacity image is 1 - T (equal to the sum to rounding).

    Edges: within one rounding of the cutoff or the stop the two paths may decide differently; the jump is then
           at most T alpha |c - behind|, see tests/splatting.
    """
    dtype = records.dtype
    out = empty_composite(width, height, dtype)
    limits = composite_limits(settings, dtype)
    share(_blend_kernel, lists.starts.size - 1, records, lists.starts, lists.ranks, limits, background, *out)
    return out, RowsSaved(records, lists, limits, out)


def composite_rows_reverse(
    d_colour: FloatArray, d_depth: FloatArray, d_opacity: FloatArray | None, saved: RowsSaved
) -> FloatArray:
    """Pair gradients (pairs, 10), as `composite_reverse`; d_opacity None = zero, at no cost."""
    dtype = saved.records.dtype
    pair_gradients = np.empty((saved.lists.ranks.size, GRADIENT), dtype)
    extra = np.empty((0, 0), dtype) if d_opacity is None else d_opacity
    share(
        _blend_reverse_kernel, saved.lists.starts.size - 1,
        saved.records, saved.lists.starts, saved.lists.ranks, saved.limits, saved.out.colour,
        saved.out.depth, saved.out.transmittance, d_colour, d_depth, extra, pair_gradients,
    )  # fmt: skip
    return pair_gradients
