"""Numbers of visited and blended pixel-Gaussian pairs of a frame: costs independent of machine, path, tile and threads.

A pair is visited if its alpha must be evaluated: the pixel is in the support of the Gaussian, and the Gaussians in
front have not terminated it. The support is alpha >= cutoff (`ellipse`), the tiles of the 3-sigma square
(`three_sigma_tiles`) or the whole picture (`everywhere`). A pair is blended if it also changes the pixel.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.splatting import compositing
from endotsr.method.splatting.compositing import _alpha_kernel
from endotsr.method.splatting.fast import blocks as compositing_blocks
from endotsr.method.splatting.render import RenderSaved


class PairCount(NamedTuple):
    """Pixel-Gaussian pairs of one frame."""

    visited: int
    blended: int


def _count(first_tile, last_tile, records, starts, ranks, limits, in_support_only, width, height, size, counts):
    real = records.dtype.type
    one, half = real(1), real(0.5)
    cutoff, stop, alpha_max = limits[0], limits[1], limits[2]
    tile_width, tile_height = size
    tiles_x = (width + tile_width - 1) // tile_width
    for tile in range(first_tile, last_tile):
        top, left = (tile // tiles_x) * tile_height, (tile % tiles_x) * tile_width
        visited, blended = 0, 0
        for row in range(top, min(height, top + tile_height)):
            for column in range(left, min(width, left + tile_width)):
                t = one
                for p in range(starts[tile], starts[tile + 1]):
                    _, _, value = _alpha_kernel(records[ranks[p]], real(column) + half, real(row) + half)
                    alpha = min(value, alpha_max)
                    if alpha < cutoff:
                        visited += 0 if in_support_only else 1
                        continue
                    visited += 1
                    behind = t * (one - alpha)
                    if behind < stop:
                        break
                    blended += 1
                    t = behind
        counts[tile, 0], counts[tile, 1] = visited, blended


_count_kernel = jit(_count)


def count_pairs(saved: RenderSaved) -> PairCount:
    """Pairs of a frame rendered by `render_forward`. Slow: do not include it in a timed block."""
    composite, camera = saved.composite, saved.camera
    module = compositing_blocks if isinstance(composite, compositing_blocks.BlocksSaved) else compositing
    ellipse = saved.settings.support == "ellipse" and saved.settings.alpha_cutoff > 0
    counts: NDArray[np.int64] = np.zeros((composite.lists.starts.size - 1, 2), np.int64)
    parallel_for(
        _count_kernel, counts.shape[0],
        composite.records, composite.lists.starts, composite.lists.ranks, composite.limits, ellipse,
        camera.width, camera.height, (module.TILE_WIDTH, module.TILE_HEIGHT), counts,
    )  # fmt: skip
    return PairCount(*(int(total) for total in counts.sum(axis=0)))
