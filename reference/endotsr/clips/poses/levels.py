"""Pictures, masks and points of all frames at one level of a pyramid, for the direct bundle adjustment.

The local mean of a picture is removed, and the rest divided by the local standard deviation: light that moves with the
scope, exposure and vignetting cancel as far as they are even over the window and the contrast is well above `FAINT`.
Both are taken over usable pixels alone, so that an instrument hardly leaves a rim.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import gaussian_blur
from endotsr.clips.opencv.geometry import grey_of, halved_blurred
from endotsr.clips.poses.pair_kernels import PyramidLevel
from endotsr.clips.poses.views import Views, known_depth, usable_pixels
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import backproject

SMOOTH, LOCAL = 1.0, 8.0  # pixels, standard deviations: blur at full size; window of mean and contrast at every level
FAINT = 16.0  # grey levels^2: added to the local variance
MOST_POINTS = 4000  # of a frame


def make_levels(views: Views, steps: tuple[int, ...]) -> list[PyramidLevel]:
    """The levels of a pyramid; step k halves the size k times."""
    planes: dict[int, list[tuple[NDArray[np.float32], BoolArray, FloatArray, FloatArray]]] = {k: [] for k in steps}
    for image, tissue, depth in zip(views.images, views.tissue, views.depth):
        grey = gaussian_blur(grey_of(image).astype(np.float32), SMOOTH)
        usable = usable_pixels(image, tissue)
        for k in range(max(steps) + 1):
            if k:
                grey = halved_blurred(grey)
            if k in planes:
                planes[k].append(_plane(grey, usable, depth, views, k))
    return [_level(planes[k], views, k) for k in steps]


def _plane(
    grey: NDArray[np.float32], usable: BoolArray, depth: NDArray[np.float32], views: Views, step: int
) -> tuple[NDArray[np.float32], BoolArray, FloatArray, FloatArray]:
    """Picture, mask, points (3, P) and their values (P,) of one frame at one level."""
    side = 2**step
    mask = np.ascontiguousarray(usable[::side, ::side])
    picture = normalised(grey, mask)
    known = known_depth(depth)[::side, ::side]
    row, column = np.nonzero(mask & (known > 0))
    thin = slice(None, None, max(1, -(-row.size // MOST_POINTS)))
    row, column = row[thin], column[thin]
    camera = views.camera._replace(rotation=np.eye(3), translation=np.zeros(3))
    z = known[row, column].astype(np.float64)
    # Sample k of a halved picture has its centre at pixel 2 k of the picture above.
    points = backproject(camera, column.astype(np.float64) * side, row.astype(np.float64) * side, z)
    return picture, mask, points, picture[row, column].astype(np.float64)


def normalised(grey: NDArray[np.float32], mask: BoolArray) -> NDArray[np.float32]:
    """(grey - local mean) / local standard deviation, both over the mask, (H, W); without meaning far from it."""
    weight = mask.astype(np.float32)
    total = np.maximum(gaussian_blur(weight, LOCAL), np.float32(1e-6))
    mean = gaussian_blur(grey * weight, LOCAL) / total
    centred = grey - mean
    variance = gaussian_blur(centred * centred * weight, LOCAL) / total
    return (centred / np.sqrt(variance + np.float32(FAINT))).astype(np.float32, copy=False)


def _level(planes: list[tuple], views: Views, step: int) -> PyramidLevel:
    pictures, usable, points, values = zip(*planes)
    sizes = [len(value) for value in values]
    side, camera = 2**step, views.camera
    centre = 0.5 - 0.5 / side  # sample k is at pixel side k: u' - 1/2 = (u - 1/2) / side
    lens = [camera.fx / side, camera.fy / side, camera.cx / side + centre, camera.cy / side + centre]
    return PyramidLevel(
        np.stack(pictures), np.stack(usable), np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp),
        np.ascontiguousarray(np.concatenate(points, axis=1)), np.concatenate(values), np.array(lens),
    )  # fmt: skip
