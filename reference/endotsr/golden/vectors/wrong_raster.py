"""Common parts of the wrong ports of the rasteriser: gradients of another preset, and a compositor in plain NumPy.

The compositor draws one Gaussian after the other on all pixels. The distance of a pixel and the support of a Gaussian
are arguments, so that a mistake in one of them leaves everything else right.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.wrong import Request, Wrong, setting


def deviating(name: str) -> Wrong:
    """A deviation of the released code in a preset that does not have it."""

    def wrong(request: Request) -> Any:
        if request.settings["raster"]["deviations"][name]:
            return None
        return setting(**{f"raster__deviations__{name}": True})(request)

    return wrong


class Screen(NamedTuple):
    """Visible Gaussians on the screen, in one precision."""

    mean2d: NDArray
    covariance2d: NDArray
    determinant: NDArray
    depth: NDArray
    opacity: NDArray
    colour: NDArray
    background: NDArray
    width: int
    height: int


def sum_of_squares(screen: Screen, n: int, dx: NDArray, dy: NDArray) -> NDArray:
    """Squared distance of pixels from a Gaussian, in units of its semi-axes; no digits cancel."""
    (_, b, c), det = screen.covariance2d[:, n], screen.determinant[n]
    return dy * dy / c + c / det * (dx - b / c * dy) ** 2


def composited(screen: Screen, raster, distance=sum_of_squares, reach=None) -> dict[str, NDArray]:
    """The three images, front to back, all pixels of one Gaussian at a time."""
    kind = screen.mean2d.dtype.type
    x, y = np.arange(screen.width, dtype=kind) + kind(0.5), np.arange(screen.height, dtype=kind)[:, None] + kind(0.5)
    left, live = np.ones((screen.height, screen.width), kind), np.ones((screen.height, screen.width), bool)
    colour, depth, opacity = np.zeros((3, *left.shape), kind), 0 * left, 0 * left
    for n in np.argsort(screen.depth, kind="stable"):
        q = distance(screen, n, x - screen.mean2d[0, n], y - screen.mean2d[1, n])
        alpha = np.minimum(screen.opacity[n] * np.exp(-q / 2), kind(raster.alpha_max))
        drawn = live & (alpha >= raster.alpha_cutoff) & (True if reach is None else reach(screen, n))
        live &= ~(drawn & (left * (1 - alpha) < raster.transmittance_stop))
        weight = np.where(drawn & live, alpha * left, kind(0))
        colour, depth = colour + weight * screen.colour[:, n, None, None], depth + weight * screen.depth[n]
        opacity, left = opacity + weight, left - weight
    colour = colour + left * screen.background[:, None, None]
    return {"colour_image": colour, "depth_image": depth, "opacity_image": opacity}


def opacity_of(logit: NDArray) -> NDArray:
    """The logistic function."""
    return 1 / (1 + np.exp(-logit))
