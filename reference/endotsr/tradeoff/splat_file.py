"""Gaussians from a splat file, and a camera that has them in view.

`.ply`  as trained splats are commonly stored: binary little-endian vertices with x y z, scale_0..2 (logarithms),
        rot_0..3 (w x y z), opacity (logit), f_dc_0..2 and, for higher degrees, f_rest_* (all of red, then green, blue)
`.npz`  arrays xyz (N, 3), log_scale (N, 3), quat_wxyz (N, 4), rgb (N, 3), opacity (N,) in [0, 1]
"""

from pathlib import Path

import numpy as np

from endotsr.config import ModelConfig
from endotsr.errors import InputError
from endotsr.export.npz import read_arrays
from endotsr.export.ply import read_gaussians, sound
from endotsr.export.scene import facing_camera
from endotsr.kernels.constants import Y00
from endotsr.scene.gaussians import Gaussians
from endotsr.tradeoff.scenes import StudyScene

SIDE = 320  # pixels of the picture
OPACITY_STEP = 1 / 255  # of 8-bit files: an opacity of 0 or 1 means half a step from it


def splat_scene(path: Path, side: int = SIDE) -> StudyScene:
    """The Gaussians of a file in a square picture. Raises InputError naming file and reason."""
    path = Path(path)
    gaussians = read_splats(path)
    camera = facing_camera(gaussians.position, side)
    distance = float(camera.translation[2] + np.median(gaussians.position[2]))
    return StudyScene(
        path.stem.removesuffix("_splats"),
        f"{path.name}, {gaussians.count} trained Gaussians seen from the front",
        gaussians, None, ModelConfig(appearance=False, spectral_motion=False, deformation=False), 0.0, camera,
        near=0.01 * distance, noise=None,
    )  # fmt: skip


def read_splats(path: Path) -> Gaussians:
    """The Gaussians, float32; those with a number that is not finite are left out. Raises InputError."""
    kind = path.suffix.lower()
    if kind not in (".ply", ".npz"):
        raise InputError(f"{path}: not a splat file; allowed: a name that ends in .ply or .npz")
    if kind == ".ply":
        return read_gaussians(path)
    try:
        found = _from_npz(path)
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]} is missing; see `endotsr tradeoff --help`") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    return sound(found, path)


def _from_npz(path: Path) -> Gaussians:
    data = read_arrays(path)
    opacity = np.clip(data["opacity"].astype(np.float64), OPACITY_STEP / 2, 1 - OPACITY_STEP / 2)
    colour = (data["rgb"].astype(np.float64) - 0.5) / Y00
    return Gaussians(
        data["xyz"].T, data["quat_wxyz"].T, data["log_scale"].T, np.log(opacity / (1 - opacity)), colour.T[None]
    )
