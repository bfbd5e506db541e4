"""How much blending a view asks for: the pixel-Gaussian pairs that change a pixel, by the definition of compositing.

A pair is blended when alpha reaches the cutoff and the pixel is not finished. The number depends on the scene and the
settings only, not on tiles or lanes, so times per pair compare across versions and renderers.
"""

import numpy as np

from endotsr.jit import jit
from endotsr.sharing import share
from endotsr.splatting.camera import Camera
from endotsr.splatting.compositing import TILE_HEIGHT, TILE_WIDTH, _alpha_kernel
from endotsr.splatting.render import Scene, render_forward
from endotsr.splatting.settings import RasterSettings


def _count_blended(first, stop, records, starts, ranks, limits, width, height, counts):
    """Pairs blended in each tile, pixel by pixel, in the order of `compositing`."""
    real = records.dtype.type
    one, half = real(1), real(0.5)
    cutoff, lowest, alpha_max = limits[0], limits[1], limits[2]
    tiles_x = (width + TILE_WIDTH - 1) // TILE_WIDTH
    for tile in range(first, stop):
        top, left = (tile // tiles_x) * TILE_HEIGHT, (tile % tiles_x) * TILE_WIDTH
        for row in range(top, min(height, top + TILE_HEIGHT)):
            for column in range(left, min(width, left + TILE_WIDTH)):
                t = one
                for p in range(starts[tile], starts[tile + 1]):
                    _, _, value = _alpha_kernel(records[ranks[p]], real(column) + half, real(row) + half)
                    alpha = min(value, alpha_max)
                    if alpha < cutoff:
                        continue
                    if t * (one - alpha) < lowest:
                        break
                    t *= one - alpha
                    counts[tile] += 1


_count_blended_kernel = jit(_count_blended)


def count_pairs(scene: Scene, camera: Camera, settings: RasterSettings, degree: int) -> dict[str, int]:
    """{"visible": Gaussians on the screen, "listed": (tile, Gaussian) pairs of the path in use, "blended": pairs}.

    Slow: what belongs beside a time, not inside it.
    """
    _, used = render_forward(scene, camera, settings, degree=degree)
    _, saved = render_forward(scene, camera, settings, degree=degree, path="definition")
    composite = saved.composite
    counts = np.zeros(composite.lists.starts.size - 1, np.int64)
    share(
        _count_blended_kernel, counts.size, composite.records, composite.lists.starts, composite.lists.ranks,
        composite.limits, camera.width, camera.height, counts,
    )  # fmt: skip
    listed = int(used.composite.lists.ranks.size)
    return {"visible": int(saved.order.size), "listed": listed, "blended": int(counts.sum())}
