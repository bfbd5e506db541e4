"""The tiles of the fast path: a tile of the image as planes of one flat buffer, and the way in and out of it.

The planes of a tile (T, red, ...) stand in one buffer at constant offsets and are indexed with unsigned integers: no
alias or wrap-around checks, so the loops over pixels become vector code. Beyond the last column lies padding with
T = 0, so that a vector may start at any column. A tile is as wide as the first-level cache allows: a Gaussian across
an edge is visited twice.
"""

import numpy as np

from endotsr.jit import jit, jit_inline

TILE_WIDTH = 64
TILE_HEIGHT = 16
PADDING = 16  # pixels; lanes of the longest vector
PITCH = TILE_WIDTH + PADDING
PLANE = PITCH * TILE_HEIGHT + PADDING  # not a multiple of 4 KiB between any two planes: they would share cache sets
FORWARD_PLANES = 5  # T, red, green, blue, depth
REVERSE_PLANES = 6  # T, behind, g_red, g_green, g_blue, g_depth

_U64 = np.uint64


def _finished(buffer):
    """Whether no pixel of the tile can take another pair: every T is zero or marked negative."""
    zero = buffer.dtype.type(0)
    alive = np.int32(0)
    for j in range(PLANE):
        alive += np.int32(buffer[_U64(j)] > zero)
    return alive == 0


finished = jit_inline(_finished)


def _clear(buffer, rows, columns):
    """Every plane 0, and T = 1 in the rows and columns that the image has here."""
    zero, one = buffer.dtype.type(0), buffer.dtype.type(1)
    for j in range(buffer.size):
        buffer[_U64(j)] = zero
    for y in range(rows):
        for x in range(columns):
            buffer[_U64(y * PITCH + x)] = one


clear = jit_inline(_clear)


def _write_rows(buffer, top, left, bottom, columns, background, colour, depth, opacity, transmittance):
    """The images plus what shines through: colour + T background."""
    one = buffer.dtype.type(1)
    red, green, blue = background[0], background[1], background[2]
    for y in range(top, bottom):
        row, at = _U64(y), _U64((y - top) * PITCH)
        for x in range(columns):
            j, column = at + _U64(x), _U64(left + x)
            t = abs(buffer[j])
            transmittance[row, column] = t
            opacity[row, column] = one - t
            depth[row, column] = buffer[j + _U64(4 * PLANE)]
        for x in range(columns):  # a loop of its own: more images at once would not become vector code
            j, column = at + _U64(x), _U64(left + x)
            t = abs(buffer[j])
            colour[0, row, column] = buffer[j + _U64(PLANE)] + t * red
            colour[1, row, column] = buffer[j + _U64(2 * PLANE)] + t * green
            colour[2, row, column] = buffer[j + _U64(3 * PLANE)] + t * blue


_write_rows_kernel = jit_inline(_write_rows)


def _write_tile(buffer, top, left, background, colour, depth, opacity, transmittance):
    """The finished tile to the images; a full tile has a width that the compiler knows."""
    bottom, columns = min(top + TILE_HEIGHT, depth.shape[0]), min(TILE_WIDTH, depth.shape[1] - left)
    if columns == TILE_WIDTH:
        _write_rows_kernel(buffer, top, left, bottom, TILE_WIDTH, background, colour, depth, opacity, transmittance)
    else:
        _write_rows_kernel(buffer, top, left, bottom, columns, background, colour, depth, opacity, transmittance)


write_tile = jit(_write_tile, contract=True)


def _read_rows(buffer, top, left, bottom, columns, colour, depth, transmittance, d_colour, d_depth, d_opacity):
    """The gradient g of each image to its plane, and <g, image> to the plane `behind`."""
    for y in range(top, bottom):
        row, at = _U64(y), _U64((y - top) * PITCH)
        for x in range(columns):
            j, column = at + _U64(x), _U64(left + x)
            g0, g1, g2 = d_colour[0, row, column], d_colour[1, row, column], d_colour[2, row, column]
            gz = d_depth[row, column]
            total = g0 * colour[0, row, column] + g1 * colour[1, row, column] + g2 * colour[2, row, column]
            buffer[j + _U64(PLANE)] = total + gz * depth[row, column]
            buffer[j + _U64(2 * PLANE)] = g0
            buffer[j + _U64(3 * PLANE)] = g1
            buffer[j + _U64(4 * PLANE)] = g2
            buffer[j + _U64(5 * PLANE)] = gz
        if d_opacity.shape[0] > 0:  # opacity = 1 - T acts like a background of colour -1
            for x in range(columns):
                column = _U64(left + x)
                buffer[at + _U64(PLANE + x)] -= d_opacity[row, column] * transmittance[row, column]


_read_rows_kernel = jit_inline(_read_rows)


def _read_tile(buffer, top, left, colour, depth, transmittance, d_colour, d_depth, d_opacity):
    """Planes behind = <g, image> and g, in a cleared buffer; `d_opacity` has no rows when nothing depends on it."""
    bottom, columns = min(top + TILE_HEIGHT, depth.shape[0]), min(TILE_WIDTH, depth.shape[1] - left)
    if columns == TILE_WIDTH:
        _read_rows_kernel(
            buffer, top, left, bottom, TILE_WIDTH, colour, depth, transmittance, d_colour, d_depth, d_opacity
        )
    else:
        _read_rows_kernel(
            buffer, top, left, bottom, columns, colour, depth, transmittance, d_colour, d_depth, d_opacity
        )


read_tile = jit(_read_tile, contract=True)
