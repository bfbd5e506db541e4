"""The fast path of compositing: the same sums as `compositing`, a block of pixels at a time.

It applies if the alpha cutoff bounds each Gaussian and alpha_max < 1 (the `paper` preset). Its optimisations:

* A Gaussian visits only the blocks that intersect its ellipse alpha >= cutoff. A block is 4x4 pixels (4x2 with
  eight-lane vectors), which small Gaussians fill better than sixteen pixels of one row. The span of each row is widened
  beyond rounding and every lane tests alpha >= cutoff, so no pixel is missed and no superfluous pixel is blended.
* The visited blocks of a tile are the bits of a word, and one loop runs over all of them. Nested loops over rows of
  blocks would have a branch at the end of every row.
* The lane loop is vector code. The pixels of a block are contiguous in flat planes (`tiles`) and within one cache
  line. The sums of a loop are local arrays in registers (`vectors`), without guards and reloads.
* Terms that depend only on the lane and on the row of blocks are computed once per Gaussian (`_lane_tables`).
* Records are prefetched a few pairs ahead: depth order is random in memory, and each would be a cache miss.
* log2(opacity) and log2(e) are folded into the exponent: alpha is a single 2^x.
* The sign of T, or T = 0, marks a finished pixel: the lane loop has selects and no branches.
* The reverse pass replays front to back: the contribution behind a pair is <g, image> minus the running sum, one
  number per pixel, without stored lists. It divides by 1 - alpha >= 1 - alpha_max; tests/method/splatting bound the
  error of this division against the R_i recursion.
"""

import math
from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.exponential import LOG2_E, exp2_nonpositive
from endotsr.method.kernels.jit import jit, jit_inline
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.kernels.vectors import fold, lanes, local_array, lowest_bit, prefetch, vector
from endotsr.method.splatting.binning import TileLists
from endotsr.method.splatting.compositing import Composite, composite_limits, empty_composite
from endotsr.method.splatting.fast.tiles import (
    BLOCK_WIDTH,
    BLOCKS_ACROSS,
    FORWARD_NUMBERS,
    PLANE,
    REVERSE_NUMBERS,
    block_height,
    clear,
    finished,
    read_tile,
    write_tile,
)
from endotsr.method.splatting.fast.tiles import (
    TILE_HEIGHT as TILE_HEIGHT,
)
from endotsr.method.splatting.fast.tiles import (
    TILE_WIDTH as TILE_WIDTH,
)
from endotsr.method.splatting.records import (
    BLUE,
    DEPTH,
    GRADIENT,
    GREEN,
    INVERSE_C,
    LOG2_OPACITY,
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

WORD_ROWS = 64 // BLOCKS_ACROSS  # rows of blocks whose visits are the bits of one word
E, CENTRE_LINE, DY = 0, 64, 128  # offsets of the three tables of `_lane_tables`, for at most WORD_ROWS rows of blocks
TABLES = 192
ROUND_UP = 0.999  # to the next column; below 1, so rounding loses no column
BATCH = 32  # pairs between two tests for a finished tile
RECORDS_AHEAD = 8  # pairs between the prefetch of a record and its use

_U64, _U32, _I32 = np.uint64, np.uint32, np.int32


class BlocksSaved(NamedTuple):
    """Inputs and images, for the reverse pass."""

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


def _visits(record, top, left, log2_cutoff, columns):
    """The blocks of a tile to visit, as bits of two words: BLOCKS_ACROSS r + c for block c of row r of the word.

    columns   scratch, int32 (TILE_HEIGHT,): the bits of each row of pixels

    With blocks of four rows the second word is empty. The first loop computes all rows of the tile at once. It has
    only 32-bit numbers: the 64-bit words would halve the number of its lanes.
    The half-width of a row is sqrt(2 ln 2 reach / A), reach = log2(alpha / cutoff) on its centre line, plus a margin
    beyond rounding: no pixel with alpha >= cutoff is missed, and a superfluous block has no effect. If a huge footprint
    just reaches a row, the reach is a difference of nearly equal numbers; `faintest` allows for its rounding.
    A row below the cutoff on its centre line has no pixel above the cutoff, rounding included, because the rest of the
    exponent is subtracted from the same number.
    """
    real = record.dtype.type
    half, one, zero = real(0.5), real(1), real(0)
    u, v, slope, log2_opacity = record[U], record[V], record[SLOPE], record[LOG2_OPACITY]
    r2 = half * real(LOG2_E) * record[INVERSE_C]
    spread, margin = one / (half * real(LOG2_E) * record[PRECISION]), abs(u) * real(1e-5) + real(1e-3)
    faintest = log2_cutoff - (one - log2_cutoff) * real(1e-6)
    first_row, across = real(top) + half - v, real(TILE_WIDTH)
    offset = u - half - real(left)
    for y in range(TILE_HEIGHT):
        dy = first_row + real(y)
        centre_line = log2_opacity - r2 * dy * dy
        middle = offset + slope * dy
        width = math.sqrt(max(spread * (centre_line - faintest), zero)) + margin
        low, high = min(max(middle - width, zero), across), min(max(middle + width + one, zero), across)
        first, stop = np.int32(low + real(ROUND_UP)), np.int32(high)
        last = np.int32(max(stop, _I32(1)) - _I32(1))
        begin, end = np.int32(_U32(first) // _U32(BLOCK_WIDTH)), np.int32(_U32(last) // _U32(BLOCK_WIDTH))
        bits = np.int32(_I32(2) << (end & _I32(31))) - np.int32(_I32(1) << (begin & _I32(31)))
        columns[_U64(y)] = np.int32(bits) if (centre_line >= log2_cutoff) & (first < stop) else _I32(0)
    first_word, second_word = _U64(0), _U64(0)
    for y in range(TILE_HEIGHT):
        row = y // block_height(record)
        bits = _U64(columns[_U64(y)]) << _U64(BLOCKS_ACROSS * (row % WORD_ROWS))
        first_word |= bits if row < WORD_ROWS else _U64(0)
        second_word |= bits if row >= WORD_ROWS else _U64(0)
    return first_word, second_word


def _lane_tables(record, top, left, word, tables):
    """e = dx - m dy, log2 alpha at e = 0, and dy of each lane, for the first block of each row of blocks of a word.

    dy is computed as in `_visits`: for large m, a rounding error of dy corresponds to many pixels.
    """
    real = record.dtype.type
    half = real(0.5)
    slope, log2_opacity = record[SLOPE], record[LOG2_OPACITY]
    r2 = half * real(LOG2_E) * record[INVERSE_C]
    first_row, first_column = real(top) + half - record[V], real(left) + half - record[U]
    above = WORD_ROWS * block_height(record) * word
    for place in range(WORD_ROWS * lanes(record)):
        k = _U64(place)
        dy = first_row + real(above + place // BLOCK_WIDTH)
        tables[k + _U64(E)] = first_column + real(place % BLOCK_WIDTH) - slope * dy
        tables[k + _U64(CENTRE_LINE)] = log2_opacity - r2 * dy * dy
        tables[k + _U64(DY)] = dy


def _first_columns(like):
    """The first column of each block of a row of blocks. A visit loads it in place of a conversion."""
    found = local_array(BLOCKS_ACROSS, like)
    for block in range(BLOCKS_ACROSS):
        found[_U64(block)] = like.dtype.type(np.int32(block * BLOCK_WIDTH))
    return found


def _visit(first_columns, word, bit):
    """For a visited block: offset of its first pixel in a plane, offset of its row in the tables, first column."""
    row, column = bit // _U64(BLOCKS_ACROSS), bit % _U64(BLOCKS_ACROSS)
    many = _U64(lanes(first_columns))
    return (_U64(64 * word) + bit) * many, row * many, first_columns[column]


_visits_kernel = jit_inline(_visits)
_lane_tables_kernel = jit_inline(_lane_tables)
_visit_kernel = jit_inline(_visit)
_first_columns_kernel = jit_inline(_first_columns)


def _record(records, ranks, p, end):
    """The record of pair p; prefetches the record of a later pair."""
    if p + RECORDS_AHEAD < end:
        prefetch(records, ranks[p + RECORDS_AHEAD])
    return records[_U64(ranks[p])]


_record_kernel = jit_inline(_record)


def _blend_block(buffer, tables, base, row, across, a2, record, log2_cutoff, stop, alpha_max):
    """Blend one Gaussian into the pixels of one block."""
    real = buffer.dtype.type
    zero = real(0)
    red, green, blue, depth = record[RED], record[GREEN], record[BLUE], record[DEPTH]
    for lane in range(lanes(buffer)):
        j = base + _U64(lane)
        e = tables[row + _U64(E + lane)] + across
        exponent = tables[row + _U64(CENTRE_LINE + lane)] - a2 * e * e
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


_blend_block_kernel = jit_inline(_blend_block)


def _blend(first_tile, last_tile, records, starts, ranks, limits, background, colour, depth, opacity, transmittance):
    real = records.dtype.type
    half = real(0.5)
    stop, alpha_max = limits[1], limits[2]
    log2_cutoff = real(math.log2(np.float64(limits[0])))  # rounded once: the same bits on every system
    height, width = depth.shape
    tiles_x, words = (width + TILE_WIDTH - 1) // TILE_WIDTH, TILE_HEIGHT // (WORD_ROWS * block_height(records))
    buffer, tables = local_array(FORWARD_NUMBERS, records), local_array(TABLES, records)
    columns, first_columns = local_array(TILE_HEIGHT, ranks), _first_columns_kernel(records)
    for tile in range(first_tile, last_tile):
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        start, end = starts[tile], starts[tile + 1]
        clear(buffer, min(TILE_HEIGHT, height - top), min(TILE_WIDTH, width - left))
        for p in range(start, end):
            if (p - start) % BATCH == 0 and finished(buffer):
                break
            record = _record_kernel(records, ranks, p, end)
            a2 = half * real(LOG2_E) * record[PRECISION]
            first_word, second_word = _visits_kernel(record, top, left, log2_cutoff, columns)
            for word in range(words):
                visits = first_word if word == 0 else second_word
                if visits != _U64(0):
                    _lane_tables_kernel(record, top, left, word, tables)
                while visits != _U64(0):
                    base, row, across = _visit_kernel(first_columns, word, lowest_bit(visits))
                    visits &= visits - _U64(1)
                    _blend_block_kernel(
                        buffer, tables, base, row, across, a2, record, log2_cutoff, stop, alpha_max
                    )  # fmt: skip
        write_tile(buffer, top, left, background, colour, depth, opacity, transmittance)


def _blend_block_reverse(buffer, sums, tables, base, row, across, a2, record, log2_cutoff, stop, alpha_max):
    """Replay one Gaussian over the pixels of one block; T becomes 0 at finished pixels."""
    real = buffer.dtype.type
    zero, one = real(0), real(1)
    red, green, blue, depth = record[RED], record[GREEN], record[BLUE], record[DEPTH]
    for lane in range(lanes(buffer)):
        j, k = base + _U64(lane), _U64(lane)
        e, dy = tables[row + _U64(E + lane)] + across, tables[row + _U64(DY + lane)]
        exponent = tables[row + _U64(CENTRE_LINE + lane)] - a2 * e * e
        value = exp2_nonpositive(exponent)
        alpha = min(value, alpha_max)
        t = buffer[j]
        weight = alpha * t if exponent >= log2_cutoff else zero
        after = t - weight
        go = after >= stop
        weight = weight if go else zero
        buffer[j] = after if go else zero
        g0, g1 = buffer[j + _U64(2 * PLANE)], buffer[j + _U64(3 * PLANE)]
        g2, gz = buffer[j + _U64(4 * PLANE)], buffer[j + _U64(5 * PLANE)]
        own = weight * (g0 * red + g1 * green + g2 * blue + gz * depth)
        behind = buffer[j + _U64(PLANE)] - own
        buffer[j + _U64(PLANE)] = behind
        passes = (weight > zero) & (value <= alpha_max)
        s = own - behind * alpha / (one - alpha) if passes else zero
        se, sy = s * e, s * dy
        sums[SUM_S][k] += s
        sums[SUM_SE][k] += se
        sums[SUM_SY][k] += sy
        sums[SUM_SEE][k] += se * e
        sums[SUM_SEY][k] += se * dy
        sums[SUM_SYY][k] += sy * dy
        sums[SUM_RED][k] += weight * g0
        sums[SUM_GREEN][k] += weight * g1
        sums[SUM_BLUE][k] += weight * g2
        sums[SUM_DEPTH][k] += weight * gz


_blend_block_reverse_kernel = jit_inline(_blend_block_reverse)


def _new_sums(like):
    """One vector for each column of a gradient record. They stay in registers while a Gaussian is replayed."""
    return (
        vector(like), vector(like), vector(like), vector(like), vector(like),
        vector(like), vector(like), vector(like), vector(like), vector(like),
    )  # fmt: skip


class PictureGrads(NamedTuple):
    """Gradients of the loss with respect to the composited images."""

    d_colour: FloatArray  # (3, H, W)
    d_depth: FloatArray  # (H, W)
    d_opacity: FloatArray  # (H, W); no rows when the loss does not depend on the opacity image


def _blend_reverse(
    first_tile, last_tile, records, starts, ranks, limits, colour, depth, transmittance, d_picture, pair_gradients
):  # fmt: skip
    d_colour, d_depth, d_opacity = d_picture
    real = records.dtype.type
    half, zero = real(0.5), real(0)
    stop, alpha_max = limits[1], limits[2]
    log2_cutoff = real(math.log2(np.float64(limits[0])))  # rounded once: the same bits on every system
    height, width = depth.shape
    tiles_x, words = (width + TILE_WIDTH - 1) // TILE_WIDTH, TILE_HEIGHT // (WORD_ROWS * block_height(records))
    buffer, tables = local_array(REVERSE_NUMBERS, records), local_array(TABLES, records)
    columns, first_columns = local_array(TILE_HEIGHT, ranks), _first_columns_kernel(records)
    sums = _new_sums_kernel(records)
    for tile in range(first_tile, last_tile):
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        start, end = starts[tile], starts[tile + 1]
        clear(buffer, min(TILE_HEIGHT, height - top), min(TILE_WIDTH, width - left))
        read_tile(buffer, top, left, colour, depth, transmittance, d_colour, d_depth, d_opacity)
        done = False
        for p in range(start, end):
            done = done or ((p - start) % BATCH == 0 and finished(buffer))
            if done:
                for j in range(GRADIENT):
                    pair_gradients[_U64(p), _U64(j)] = zero
                continue
            for column in sums:
                for lane in range(lanes(records)):
                    column[_U64(lane)] = zero
            record = _record_kernel(records, ranks, p, end)
            a2 = half * real(LOG2_E) * record[PRECISION]
            first_word, second_word = _visits_kernel(record, top, left, log2_cutoff, columns)
            for word in range(words):
                visits = first_word if word == 0 else second_word
                if visits != _U64(0):
                    _lane_tables_kernel(record, top, left, word, tables)
                while visits != _U64(0):
                    base, row, across = _visit_kernel(first_columns, word, lowest_bit(visits))
                    visits &= visits - _U64(1)
                    _blend_block_reverse_kernel(
                        buffer, sums, tables, base, row, across, a2, record, log2_cutoff, stop, alpha_max
                    )  # fmt: skip
            for j in range(GRADIENT):
                pair_gradients[_U64(p), _U64(j)] = fold(sums[j])


_new_sums_kernel = jit_inline(_new_sums)
_blend_kernel = jit(_blend, contract=True)
_blend_reverse_kernel = jit(_blend_reverse, contract=True)


def composite_blocks_forward(
    records: FloatArray, lists: TileLists, settings: RasterSettings, background: FloatArray, width: int, height: int
) -> tuple[Composite, BlocksSaved]:
    """As `composite_forward`, on tiles of 64x16 pixels; the opacity image is 1 - T (equal to the sum to rounding).

    Edges: within rounding of the cutoff or the stop, the two paths may decide differently about a Gaussian k. If the
           decisions about those behind it stay, the colour then differs by T_k alpha_k |rgb_k - R_{k+1}| at the cutoff
           and by T_k |R_k - background| at the stop, with the R of (B5c). A colour that is not finite reaches all
           visited blocks of its Gaussian.
    """
    dtype = records.dtype
    out = empty_composite(width, height, dtype)
    limits = composite_limits(settings, dtype)
    parallel_for(_blend_kernel, lists.starts.size - 1, records, lists.starts, lists.ranks, limits, background, *out)
    return out, BlocksSaved(records, lists, limits, out)


def composite_blocks_reverse(
    d_colour: FloatArray, d_depth: FloatArray, d_opacity: FloatArray | None, saved: BlocksSaved
) -> FloatArray:
    """Pair gradients (pairs, 10), as `composite_reverse`; d_opacity None = zero, without computation."""
    dtype = saved.records.dtype
    pair_gradients = np.empty((saved.lists.ranks.size, GRADIENT), dtype)
    extra = np.empty((0, 0), dtype) if d_opacity is None else d_opacity
    parallel_for(
        _blend_reverse_kernel, saved.lists.starts.size - 1,
        saved.records, saved.lists.starts, saved.lists.ranks, saved.limits, saved.out.colour,
        saved.out.depth, saved.out.transmittance, PictureGrads(d_colour, d_depth, extra), pair_gradients,
    )  # fmt: skip
    return pair_gradients
