"""A camera and a few Gaussians for the gradient checks of the rasteriser and of the objective."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from endotsr.method.splatting.settings import PAPER
from endotsr.port.operations.operation import Settings

WIDTH, HEIGHT = 21, 17
COUNT = 8
LENS = {"fx": 19.0, "fy": 23.0, "cx": 9.5, "cy": 9.0, "width": WIDTH, "height": HEIGHT}
# Each visible Gaussian of `raw_gaussians` is above this alpha at all pixels or below it at all pixels. The cutoff
# contour does not cross the image, so finite differences see a smooth function. tests/method/splatting has tests of the
# contour.
WIDE = PAPER._replace(alpha_cutoff=1e-4)
AXES = {f"position {axis}": (k, slice(None)) for k, axis in enumerate("xyz")}  # blocks of a position array


def is_near(preset: str) -> Callable[[Settings], bool]:
    """Whether the rasteriser settings of a case resemble this preset more than the other of `exact` and `paper`."""
    return lambda settings: preset == ("exact" if settings["raster"]["support"] == "everywhere" else "paper")


def pose() -> dict[str, NDArray]:
    """Rotated and shifted world-to-camera pose."""
    angle = np.array([0.2, -0.15, 0.1])
    c, s = np.cos(angle), np.sin(angle)
    x = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    y = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    z = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    return {"rotation_matrix": z @ y @ x, "translation": np.array([0.1, -0.2, 0.3])}


def positions(rng: np.random.Generator, count: int = COUNT) -> NDArray:
    """In front of the camera at well separated depths, not in depth order."""
    z = 3.0 + 0.35 * rng.permutation(count) + rng.uniform(-0.05, 0.05, count)
    seen = np.stack([rng.uniform(-0.3, 0.3, count) * z, rng.uniform(-0.3, 0.3, count) * z, z])
    return pose()["rotation_matrix"].T @ (seen - pose()["translation"][:, None])


def raw_gaussians(rng: np.random.Generator) -> dict[str, NDArray]:
    """Wide overlapping Gaussians; index 0 is behind the camera, index 1 is below any cutoff."""
    position = positions(rng)
    position[:, 0] -= pose()["rotation_matrix"].T @ np.array([0.0, 0.0, 20.0])
    logit = rng.uniform(-1.5, 1.5, COUNT)
    logit[1] = -12.0
    return {
        "position": position,
        "quaternion": rng.normal(0, 1, (4, COUNT)) + np.array([[1.5], [0], [0], [0]]),
        "log_scale": rng.uniform(0.25, 0.7, (3, COUNT)),
        "opacity_logit": logit,
        "harmonics": rng.uniform(-0.25, 0.25, (16, 3, COUNT)) + 0.4 * (np.arange(16) == 0)[:, None, None],
        "residual": rng.uniform(-0.2, 0.2, (3, COUNT)),
    }
