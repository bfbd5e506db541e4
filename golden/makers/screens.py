"""Gaussians on the screen as inputs, for the families of compositing."""

import numpy as np

from endotsr.method.splatting.settings import RasterSettings
from endotsr.port.operations.requests import raster_dict
from makers.making import Made, Seeds, given, permutation
from makers.views import preset_of

WIDTH, HEIGHT = 18, 13


def raster_settings(raster: RasterSettings) -> dict:
    """Rasteriser and image size as settings of a case of `composite`."""
    return {"preset": preset_of(raster), "raster": raster_dict(raster), "width": WIDTH, "height": HEIGHT}


def screen_inputs(seeds: Seeds, count: int, low: float, high: float) -> dict[str, Made]:
    """Overlapping Gaussians, with covariance diagonals of `low` to `high` px^2, and gradients of the images."""
    a, c = (seeds.uniform(name, low, high, count).array for name in ("a", "c"))
    skew = seeds.uniform("skew", -0.6, 0.6, count).array
    across = seeds.uniform("mean2d", 0.0, 1.0, 2, count)
    z = 3.0 + 0.35 * permutation(seeds.seed("order"), count)
    mean = given(across.array * np.array([[WIDTH], [HEIGHT]]), f"{across.recipe}, times image size", "px")
    recipe = (f"a, s sqrt(a c), c; a, c = uniform({low}, {high}) seeds {seeds.seed('a')}, {seeds.seed('c')}; "
              f"s = uniform(-0.6, 0.6) seed {seeds.seed('skew')}")  # fmt: skip
    cover = given(np.stack([a, skew * np.sqrt(a * c), c]), recipe, "px^2")
    return {
        "mean2d": mean,
        "covariance2d": cover,
        "opacity_logit": seeds.uniform("opacity_logit", -2.0, 2.0, count),
        "colour": seeds.uniform("colour", 0.1, 1.0, 3, count, unit="display"),
        "depth": given(z, f"3 + 0.35 k, k = stable order of the words of {seeds.seed('order')}", "scene unit"),
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
        "d_colour_image": seeds.uniform("d_colour_image", -1.0, 1.0, 3, HEIGHT, WIDTH),
        "d_depth_image": seeds.uniform("d_depth_image", -1.0, 1.0, HEIGHT, WIDTH),
        "d_opacity_image": seeds.uniform("d_opacity_image", -1.0, 1.0, HEIGHT, WIDTH),
    }


def flat_covariance(count: int) -> Made:
    """Gaussians with constant alpha over the image."""
    wide = np.array([[4e6] * count, [0.0] * count, [4e6] * count])
    return given(wide, "a = c = 4e6, b = 0: flat over the image", "px^2")
