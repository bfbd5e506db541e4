"""Cameras and Gaussians in view, for every family that renders."""

from typing import Any

import numpy as np

from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER, RasterSettings
from endotsr.port.operations.requests import raster_dict
from makers.making import Made, Seeds, changed, given, permutation, single

PRESETS = {"exact": EXACT, "paper": PAPER, "legacy": LEGACY}
LENS = {"fx": 19.0, "fy": 23.0, "cx": 9.5, "cy": 9.25, "width": 21, "height": 17}


def pose(static: bool = False) -> dict[str, Made]:
    """World-to-camera pose: the identity, or rotated about all axes and shifted."""
    if static:
        return {
            "rotation_matrix": given(np.eye(3), "identity"),
            "translation": given(np.zeros(3), "0", "scene unit"),
        }
    c, s = np.cos([0.2, -0.15, 0.1]), np.sin([0.2, -0.15, 0.1])
    x = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    y = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    z = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    return {
        "rotation_matrix": given(z @ y @ x, "Rz(0.1) Ry(-0.15) Rx(0.2)"),
        "translation": given([0.125, -0.25, 0.3125], "1/8, -1/4, 5/16", "scene unit"),
    }


def seen_at(points: np.ndarray, cast: dict[str, Made]) -> Made:
    """World positions of points given in camera axes."""
    world = cast["rotation_matrix"].array.T @ (points - cast["translation"].array[:, None])
    return given(world, "W^T (p - d) of points p in camera axes, see *Recipes* in README.md", "scene unit")


def shape_inputs(seeds: Seeds, count: int) -> dict[str, Made]:
    """Rotations, semi-axes and gradients with respect to the outputs of `projection`."""
    quaternion = seeds.uniform("quaternion", -1.0, 1.0, 4, count).array
    rotation = covariance_forward(quaternion, np.zeros((3, count)))[0].rotation
    return {
        "rotation": given(rotation, f"R of uniform(-1, 1) quaternions, seed {seeds.seed('quaternion')}"),
        "scale": seeds.uniform("scale", 0.2, 1.0, 3, count, unit="scene unit"),
        "d_mean2d": seeds.uniform("d_mean2d", -1.0, 1.0, 2, count, unit="loss per px"),
        "d_covariance2d": seeds.uniform("d_covariance2d", -1.0, 1.0, 3, count, unit="loss per px^2"),
        "d_depth": seeds.uniform("d_depth", -1.0, 1.0, count, unit="loss per scene unit"),
    }


def spread_points(seeds: Seeds, count: int, reach: float = 0.3) -> np.ndarray:
    """Camera-space points at well separated depths, not in index order."""
    z = single(3.0 + 0.35 * permutation(seeds.seed("order"), count))
    u = seeds.uniform("u", -reach, reach, count).array
    v = seeds.uniform("v", -reach, reach, count).array
    return np.stack([u * z, v * z, z])


def lens_settings(raster: RasterSettings, **more: Any) -> dict[str, Any]:
    """Rasteriser and lens as settings."""
    return {"preset": preset_of(raster), "raster": raster_dict(raster), "camera": LENS} | more


def preset_of(raster: RasterSettings) -> str:
    """The name of the preset that shares the most of these settings."""
    same = {name: sum(a == b for a, b in zip(raster, preset, strict=True)) for name, preset in PRESETS.items()}
    return max(same, key=lambda name: (PRESETS[name].support == raster.support, same[name]))


def logit_of(opacity: list[float]) -> Made:
    """Logits of opacities."""
    values = np.array(opacity)
    return given(np.log(values) - np.log1p(-values), "logit of " + ", ".join(f"{v:.6g}" for v in opacity))


def scene_inputs(seeds: Seeds, count: int, degree: int, cast: dict[str, Made]) -> dict[str, Made]:
    """Raw parameters of overlapping Gaussians in view of a camera."""
    quaternion = seeds.uniform("quaternion", -1.0, 1.0, 4, count)
    harmonics = seeds.uniform("harmonics", -0.25, 0.25, (degree + 1) ** 2, 3, count)
    first = harmonics.array[0] * 3 + 0.5
    return {
        "position": seen_at(spread_points(seeds, count, 0.4), cast),
        "quaternion": changed(quaternion, 0, quaternion.array[0] + 1.5, "w plus 1.5"),
        "log_scale": seeds.uniform("log_scale", -1.2, 0.2, 3, count),
        "opacity_logit": seeds.uniform("opacity_logit", -1.5, 3.0, count),
        "harmonics": changed(harmonics, 0, first, "[0] times 3 plus 0.5"),
    } | cast


def cotangents(seeds: Seeds) -> dict[str, Made]:
    """Upstream gradients with respect to the images, and a background."""
    height, width = LENS["height"], LENS["width"]
    return {
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
        "d_colour_image": seeds.uniform("d_colour_image", -1.0, 1.0, 3, int(height), int(width)),
        "d_depth_image": seeds.uniform("d_depth_image", -1.0, 1.0, int(height), int(width)),
        "d_opacity_image": seeds.uniform("d_opacity_image", -1.0, 1.0, int(height), int(width)),
    }
