"""The tiles of the fast path: the planes of an image tile in one flat buffer, and transfers to and from the images.

The planes of a tile (T, red, ...) have constant offsets in one buffer. Unsigned indices need no alias or wrap-around
checks, so the loops over pixels vectorise. In a plane, the pixels of a block (one per vector lane) are contiguous, row
by row; so are the blocks of a row of blocks. A Gaussian across a tile edge is visited twice, which favours wide
tiles; with still wider tiles there would be too few for the threads.
"""

import numpy as np

from endotsr.method.kernels.jit import jit, jit_inline
from endotsr.method.kernels.vectors import lanes

TILE_WIDTH = 64
TILE_HEIGHT = 16
BLOCK_WIDTH = 4
BLOCKS_ACROSS = TILE_WIDTH // BLOCK_WIDTH
PIXELS = TILE_WIDTH * TILE_HEIGHT
PLANE = PIXELS + 16  # planes a multiple of 4 KiB apart would share cache sets
FORWARD_NUMBERS = 5 * PLANE  # T, red, green, blue, depth
REVERSE_NUMBERS = 6 * PLANE  # T, behind, g_red, g_green, g_blue, g_depth

_U64 = np.uint64


def _block_height(like):
    """Rows of a block: 4, or 2 if a vector has eight lanes."""
    return lanes(like) // BLOCK_WIDTH


block_height = jit_inline(_block_height)


def _place(like, y, x):
    """Offset in a plane of the pixel in row y and column x of a tile."""
    row, column, wide, high = _U64(y), _U64(x), _U64(BLOCK_WIDTH), _U64(block_height(like))
    block = row // high * _U64(BLOCKS_ACROSS) + column // wide
    return block * _U64(lanes(like)) + row % high * wide + column % wide


place = jit_inline(_place)


def _finished(buffer):
    """Whether every pixel of the tile is finished: each T is zero or marked negative."""
    zero = buffer.dtype.type(0)
    alive = np.int32(0)
    for j in range(PIXELS):
        alive += np.int32(buffer[_U64(j)] > zero)
    return alive == 0


finished = jit_inline(_finished)


def _clear(buffer, rows, columns):
    """Set every plane to 0, and T to 1 in the rows and columns inside the image."""
    zero, one = buffer.dtype.type(0), buffer.dtype.type(1)
    for j in range(buffer.size):
        buffer[_U64(j)] = zero
    for y in range(rows):
        for x in range(columns):
            buffer[place(buffer, y, x)] = one


clear = jit_inline(_clear)


def _write_tile(buffer, top, left, background, colour, depth, opacity, transmittance):
    """Write the finished tile to the images, with the background: colour + T background."""
    one = buffer.dtype.type(1)
    red, green, blue = background[0], background[1], background[2]
    for y in range(min(TILE_HEIGHT, depth.shape[0] - top)):
        row = _U64(top + y)
        for x in range(min(TILE_WIDTH, depth.shape[1] - left)):
            j, column = place(buffer, y, x), _U64(left + x)
            t = abs(buffer[j])
            transmittance[row, column] = t
            opacity[row, column] = one - t
            depth[row, column] = buffer[j + _U64(4 * PLANE)]
            colour[0, row, column] = buffer[j + _U64(PLANE)] + t * red
            colour[1, row, column] = buffer[j + _U64(2 * PLANE)] + t * green
            colour[2, row, column] = buffer[j + _U64(3 * PLANE)] + t * blue


write_tile = jit(_write_tile, contract=True)


def _read_tile(buffer, top, left, colour, depth, transmittance, d_colour, d_depth, d_opacity):
    """Write behind = <g, image> and g to the planes of a cleared buffer; an unused `d_opacity` has no rows."""
    for y in range(min(TILE_HEIGHT, depth.shape[0] - top)):
        row = _U64(top + y)
        for x in range(min(TILE_WIDTH, depth.shape[1] - left)):
            j, column = place(buffer, y, x), _U64(left + x)
            g0, g1, g2 = d_colour[0, row, column], d_colour[1, row, column], d_colour[2, row, column]
            gz = d_depth[row, column]
            total = g0 * colour[0, row, column] + g1 * colour[1, row, column] + g2 * colour[2, row, column]
            buffer[j + _U64(PLANE)] = total + gz * depth[row, column]
            buffer[j + _U64(2 * PLANE)] = g0
            buffer[j + _U64(3 * PLANE)] = g1
            buffer[j + _U64(4 * PLANE)] = g2
            buffer[j + _U64(5 * PLANE)] = gz
            if d_opacity.shape[0] > 0:  # opacity = 1 - T acts like a background of colour -1
                buffer[j + _U64(PLANE)] -= d_opacity[row, column] * transmittance[row, column]


read_tile = jit(_read_tile, contract=True)
