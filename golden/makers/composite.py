"""Family `composite`: blending of screen Gaussians (B5) and its gradients; `composite_limits` has its thresholds.

Inputs: screen means, screen covariances, logits, colours, depths, a background and gradients with respect to the three
images. The cases test the order (by depth, ties by index), the background, the position of pixel centres, the tiles of
the preset legacy, and gradients without division by 1 - alpha.
"""

import numpy as np

from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER
from endotsr.port.operations.compositing import IMAGES
from makers.making import Seeds, Spec, given
from makers.operations import PER_DISPLAY, PER_LENGTH, Declared, Judged
from makers.screens import flat_covariance, raster_settings, screen_inputs
from makers.views import PRESETS, logit_of

UNITS = dict(zip(IMAGES, ("display", "scene unit", "1")))
FORWARD, REVERSE = "compositing.composite_forward", "compositing.composite_reverse"
DECLARED = {
    "composite": Declared(
        {
            **{name: Judged(1, unit, oracle=FORWARD) for name, unit in UNITS.items()},
            "d_mean2d": Judged(2, "loss per px", "last", REVERSE),
            "d_covariance2d": Judged(2, "loss per px^2", "last", REVERSE),
            "d_opacity_logit": Judged(2, "loss", "last", REVERSE),
            "d_colour": Judged(2, PER_DISPLAY, "last", REVERSE),
            "d_depth": Judged(2, PER_LENGTH, "last", REVERSE),
            "d_background": Judged(2, PER_DISPLAY, oracle=REVERSE),
        },
        "from screen quantities; det = a c - b^2, here only, where nothing else is given: in `render` det comes from"
        " the sum of (B3); `d_covariance2d[1]` is the derivative by the scalar b",
    )
}
OPERATIONS = tuple(DECLARED)


def _preset(name: str) -> Spec:
    flags = ("order_by_index", "order_reversed", "depth_over_opacity", "background_missing", "pixel_corner_sample",
             "depth_gradient_dropped", "alpha_gradient_without_rest", "covariance_off_diagonal_half",
             "alpha_gradient_without_background", "opacity_gradient_without_sigmoid")  # fmt: skip
    if name == "legacy":
        flags = tuple(flag for flag in flags if flag != "depth_gradient_dropped")
    inputs = screen_inputs(Seeds("composite", name), 8, 4.0, 90.0)
    title = f"Preset {name}: overlapping Gaussians, depth order unlike index order"
    return Spec("composite", name, "composite", title, flags, raster_settings(PRESETS[name]), inputs)


def _equal_depths() -> Spec:
    depths = [4.0, 4.0, 3.0, 4.0, 4.0]
    inputs = screen_inputs(Seeds("composite", "equal_depths"), 5, 4.0, 90.0)
    inputs |= {"covariance2d": flat_covariance(5), "opacity_logit": logit_of([0.3, 0.4, 0.5, 0.6, 0.7])}
    inputs["depth"] = given(depths, ", ".join(map(str, depths)), "scene unit")
    return Spec("composite", "equal_depths", "composite", "Equal depths keep the order of the index",
                ("ties_reversed",), raster_settings(PAPER), inputs, ("depth",))  # fmt: skip


def _opaque_exact() -> Spec:
    inputs = screen_inputs(Seeds("composite", "opaque_exact"), 4, 1.0, 4.0)
    wide = np.array([[1e18, 9.0, 9.0, 9.0], [0.0] * 4, [1e18, 9.0, 9.0, 9.0]])
    inputs |= {
        "opacity_logit": given([40.0, -40.0, 2.0, 40.0], "40, -40, 2, 40"),
        "covariance2d": given(wide, "a = c = 1e18, 9, 9, 9; b = 0", "px^2"),
        "depth": given([4.0, 5.0, 3.0, 6.0], "4, 5, 3, 6", "scene unit"),
    }
    return Spec("composite", "opaque_exact", "composite", "Alpha of 1 in front: no division by 1 - alpha",
                ("divide_by_one_minus_alpha",), raster_settings(EXACT), inputs, without=("d_background",))  # fmt: skip


def tile_case(case: str, title: str, flags: tuple[str, ...], u: list[float], v: list[float], size: list[float]) -> Spec:
    """Three discs in preset legacy, with their centres and the variances of their axes."""
    seeds, (width, height) = Seeds("composite", case), (48, 20)
    shapes = {
        "d_colour_image": (3, height, width),
        "d_depth_image": (height, width),
        "d_opacity_image": (height, width),
    }
    centres = ", ".join(f"({x:g}, {y:g})" for x, y in zip(u, v, strict=True))
    inputs = {
        "mean2d": given([u, v], centres, "px"),
        "covariance2d": given([size, [0.0] * 3, size], f"a = c = {', '.join(f'{a:g}' for a in size)}; b = 0", "px^2"),
        "opacity_logit": logit_of([0.95, 0.9, 0.97]),
        "colour": seeds.uniform("colour", 0.1, 1.0, 3, 3, unit="display"),
        "depth": given([5.0, 4.0, 3.0], "5, 4, 3", "scene unit"),
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
        **{name: seeds.uniform(name, -1.0, 1.0, *shape) for name, shape in shapes.items()},
    }
    settings = raster_settings(LEGACY) | {"width": width, "height": height}
    return Spec("composite", case, "composite", title, flags, settings, inputs)


def _tile_ends() -> list[Spec]:
    """Discs with a radius or centre for which the right rule and a wrong rule give different tiles.

    3 sqrt(2.458 + sqrt(0.1)) is 4.997: a larger number under the inner root makes the radius 6 instead of 5.
    """
    flags = ("tiles_from_the_mean", "tiles_root_without_floor", "tiles_unbounded")
    ends = "Where the tiles of a Gaussian end: centre less half a pixel, the root at least 0.1"
    return [
        tile_case("tiles", ends, flags, [46.75, 47.25, 24.3], [8.2, 11.7, 10.25], [99.9, 99.9, 4.0]),
        tile_case("tile_root", "A disc whose radius is just below 5: no more than 0.1 stands under the root",
                   ("tiles_unbounded",), [12.0, 30.0, 28.0], [10.2, 9.4, 6.5], [2.458, 9.0, 30.0]),
    ]  # fmt: skip


def cases() -> list[Spec]:
    """The three presets, equal depths, opaque Gaussians, the ends of tiles."""
    return [*(_preset(name) for name in PRESETS), _equal_depths(), _opaque_exact(), *_tile_ends()]
