"""A trained scene in place of the common workload, with the sizes, needles and opacities that training produces."""

from pathlib import Path

import numpy as np

from endotsr.config import Config
from endotsr.export.npz import read_arrays
from endotsr.kernels.constants import Y00
from endotsr.scene import workload
from endotsr.scene.gaussians import Gaussians

DEPTH = 4.0  # scene units of the middle of the scene, that of the common workload
PERCENTILES = (1, 99)  # of the positions: the range that is scaled to the picture


def trained_gaussians(path: Path, config: Config, seed: int = 7) -> Gaussians:
    """The scene, moved and scaled to fill the common camera's picture, with small time-dependent parameters.

    path   npz, see `export.npz`
    Raises: InputError naming the file and what is missing.
    """
    found = read_arrays(path)
    position, log_scale = found["xyz"].T.astype(np.float64), found["log_scale"].T.astype(np.float64)
    low, high = np.percentile(position, PERCENTILES, axis=1)
    across = max((high - low)[0] / workload.WIDTH, (high - low)[1] / workload.HEIGHT)  # scene units a pixel
    factor = DEPTH / workload.FOCAL / across
    middle = (low + high)[:, None] / 2
    opacity = np.clip(found["opacity"].astype(np.float64), 1e-4, 1 - 1e-4)
    harmonics = np.zeros(((config.model.harmonics_degree + 1) ** 2, 3, opacity.size))
    harmonics[0] = (found["rgb"].T - 0.5) / Y00
    dtype = np.dtype(config.training.precision)
    cast = lambda array: np.ascontiguousarray(array, dtype)
    scene = Gaussians(
        position=cast((position - middle) * factor + np.array([[0.0], [0.0], [DEPTH]])),
        quaternion=cast(found["quat_wxyz"].T),
        log_scale=cast(log_scale + np.log(factor)),
        opacity_logit=cast(np.log(opacity / (1 - opacity))),
        harmonics=cast(harmonics),
    )
    sigma = float(np.exp(np.median(scene.log_scale)))
    return scene._replace(**workload.temporal(np.random.default_rng(seed), opacity.size, config, sigma))
