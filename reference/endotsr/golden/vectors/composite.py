"""Family `composite`: blending of screen Gaussians (B5) and its gradients; `composite_limits` has its thresholds.

Screen means, screen covariances, logits, colours, depths, a background and gradients by the three images come in. The
cases fix the order (by depth, ties by index), the background, the place of pixel centres, the reach of tiles in preset
legacy, and gradients that need no division by 1 - alpha.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Seeds, Spec, given
from endotsr.golden.vectors.screens import flat_covariance, raster_settings, screen_inputs
from endotsr.golden.vectors.views import PRESETS, logit_of
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort, setting, swapped
from endotsr.golden.vectors.wrong_raster import Screen, composited, deviating, opacity_of
from endotsr.splatting.settings import EXACT, LEGACY, PAPER
from endotsr.stages.requests import raster_of

OPERATIONS = ("composite",)


def _preset(name: str) -> Spec:
    flags = ("order_by_index", "order_reversed", "depth_over_opacity", "background_missing", "pixel_corner_sample",
             "depth_gradient_dropped", "alpha_gradient_without_rest", "covariance_off_diagonal_half")  # fmt: skip
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
    wide = np.array([[1e12, 9.0, 9.0, 9.0], [0.0] * 4, [1e12, 9.0, 9.0, 9.0]])
    inputs |= {
        "opacity_logit": given([40.0, -40.0, 2.0, 40.0], "40, -40, 2, 40"),
        "covariance2d": given(wide, "a = c = 1e12, 9, 9, 9; b = 0", "px^2"),
        "depth": given([4.0, 5.0, 3.0, 6.0], "4, 5, 3, 6", "scene unit"),
    }
    return Spec("composite", "opaque_exact", "composite", "Alpha of 1 in front: no division by 1 - alpha",
                ("divide_by_one_minus_alpha",), raster_settings(EXACT), inputs, without=("d_background",))  # fmt: skip


def _tile_ends() -> Spec:
    """Discs whose radius or centre puts the end of their tiles between the right rule and a wrong one."""
    seeds, (width, height) = Seeds("composite", "tiles"), (48, 20)
    shapes = {
        "d_colour_image": (3, height, width),
        "d_depth_image": (height, width),
        "d_opacity_image": (height, width),
    }
    size = [99.9, 99.9, 4.0]
    inputs = {
        "mean2d": given([[46.75, 47.25, 24.3], [8.2, 11.7, 10.25]], "(46.75, 8.2), (47.25, 11.7), (24.3, 10.25)", "px"),
        "covariance2d": given([size, [0.0] * 3, size], "a = c = 99.9, 99.9, 4; b = 0", "px^2"),
        "opacity_logit": logit_of([0.95, 0.9, 0.97]),
        "colour": seeds.uniform("colour", 0.1, 1.0, 3, 3, unit="display"),
        "depth": given([5.0, 4.0, 3.0], "5, 4, 3", "scene unit"),
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
        **{name: seeds.uniform(name, -1.0, 1.0, *shape) for name, shape in shapes.items()},
    }
    settings = raster_settings(LEGACY) | {"width": width, "height": height}
    return Spec("composite", "tiles", "composite", "Where the tiles of a Gaussian end: centre less half a pixel, the "
                "root at least 0.1", ("tiles_from_the_mean", "tiles_root_without_floor"), settings, inputs)  # fmt: skip


def cases() -> list[Spec]:
    """The three presets, equal depths, opaque Gaussians, the ends of tiles."""
    return [*(_preset(name) for name in PRESETS), _equal_depths(), _opaque_exact(), _tile_ends()]


# ---- mistakes ----


def _reordered(depth_of) -> Wrong:
    """Composites in another order: other depths, and the depth image of the right ones left out."""

    def wrong(request: Request) -> dict[str, NDArray]:
        inputs = dict(request.inputs)
        index = depth_of(inputs["depth"])
        order = np.argsort(index, kind="stable")
        names = ("mean2d", "covariance2d", "opacity_logit", "colour", "depth")
        moved = inputs | {name: np.ascontiguousarray(inputs[name][..., order]) for name in names}
        moved["depth"] = np.arange(1.0, order.size + 1.0).astype(inputs["depth"].dtype)
        found = request.run(moved, request.settings)
        found.pop("depth_image")
        back = np.argsort(order)
        return {
            name: np.ascontiguousarray(a[..., back]) if name.startswith("d_") and name != "d_background" else a
            for name, a in found.items()
        }

    return wrong


def _ties_reversed(request: Request) -> dict[str, NDArray] | None:
    """The last index of equal depths in front."""
    names = [n for n in ("mean2d", "covariance2d", "opacity_logit", "colour", "depth", "position", "quaternion",
                         "log_scale", "harmonics", "residual") if n in request.inputs]  # fmt: skip
    inputs = dict(request.inputs) | {n: np.ascontiguousarray(request.inputs[n][..., ::-1]) for n in names}
    found = request.run(inputs, request.settings)
    whole = ("d_background", "d_rotation_matrix", "d_translation")
    return {n: np.ascontiguousarray(a[..., ::-1]) if n.startswith(("d_", "visible")) and n not in whole else a
            for n, a in found.items()}  # fmt: skip


def _depth_over_opacity(request: Request) -> dict[str, NDArray]:
    opacity = request.right["opacity_image"]
    return {"depth_image": request.right["depth_image"] / np.where(opacity > 0, opacity, 1.0)}


def _no_background(request: Request) -> dict[str, NDArray]:
    left = 1 - request.right["opacity_image"]
    return {"colour_image": request.right["colour_image"] - left * request.inputs["background"][:, None, None]}


def _own_colour_only(request: Request) -> dict[str, NDArray]:
    """Gradient of alpha without the Gaussians behind, on a black background."""
    count = request.inputs["opacity_logit"].size
    gradient = np.zeros(count)
    for i in range(count):
        names = ("mean2d", "covariance2d", "opacity_logit", "colour", "depth")
        inputs = dict(request.inputs)
        nearer = np.flatnonzero((inputs["depth"] < inputs["depth"][i]) | (np.arange(count) == i))
        inputs |= {n: np.ascontiguousarray(inputs[n][..., nearer]) for n in names}
        inputs["background"] = np.zeros_like(inputs["background"])
        found = request.run(inputs, request.settings)["d_opacity_logit"]
        gradient[i] = found[np.flatnonzero(nearer == i)[0]]
    return {"d_opacity_logit": gradient}


def _half_off_diagonal(request: Request) -> dict[str, NDArray]:
    if "d_covariance2d" not in request.right:
        return {}
    d = request.right["d_covariance2d"].copy()
    d[1] *= 0.5
    return {"d_covariance2d": d}


def _division(request: Request) -> dict[str, NDArray] | None:
    """The colour behind found by dividing by 1 - alpha."""
    alpha = opacity_of(request.inputs["opacity_logit"])
    if alpha.max() < 1:
        return None
    return {"d_opacity_logit": request.right["d_opacity_logit"] * np.where(alpha == 1, np.nan, 1.0)}


def _without_deviations(request: Request) -> Any:
    off = {name: False for name in request.settings["raster"]["deviations"]}
    if request.settings["raster"]["deviations"] == off:
        return None
    return setting(raster__deviations=off)(request)


def _tiles(half: float = 0.5, floor: float = 0.1) -> Wrong:
    """Another end of the tiles in support `three_sigma_tiles`; the images only."""

    def reach(screen: Screen, n: int) -> NDArray:
        (a, _, c), det = screen.covariance2d[:, n], screen.determinant[n]
        mean = (a + c) / 2
        radius = np.ceil(3 * np.sqrt(mean + np.sqrt(max(floor, mean * mean - det))))
        inside = []
        for centre, pixels in zip(screen.mean2d[:, n] - half, (screen.width, screen.height)):
            tile = np.arange(pixels) // 16
            inside.append((tile >= int((centre - radius) / 16)) & (tile < int((centre + radius + 15) / 16)))
        return inside[1][:, None] & inside[0]

    def wrong(request: Request) -> dict[str, NDArray] | None:
        raster, i = raster_of(request.settings), request.inputs
        if raster.support != "three_sigma_tiles":
            return None
        a, b, c = i["covariance2d"]
        size = request.settings["width"], request.settings["height"]
        opacity = opacity_of(i["opacity_logit"])
        screen = Screen(
            i["mean2d"], i["covariance2d"], a * c - b * b, i["depth"], opacity, i["colour"], i["background"], *size
        )
        return composited(screen, raster, reach=reach)

    return wrong


WRONG_PORTS = [
    WrongPort("pixel_corner_sample", "Pixels sampled at their corner", "at i; right: at i + 1/2",
              {"composite": swapped(lambda i: {"mean2d": i["mean2d"] + 0.5})}),
    WrongPort("order_by_index", "Composited in index order", "index; right: view depth",
              {"composite": _reordered(lambda z: np.arange(z.size))}),
    WrongPort("order_reversed", "Composited back to front", "far first; right: near first",
              {"composite": _reordered(lambda z: -z)}),
    WrongPort("ties_reversed", "Equal depths in reverse order", "last index first; right: index order",
              {"composite": _ties_reversed, "render": _ties_reversed}),
    WrongPort("depth_over_opacity", "Depth divided by opacity", "normalised; right: the sum",
              {"composite": _depth_over_opacity, "render": _depth_over_opacity}),
    WrongPort("background_missing", "Background left out", "0; right: T times background",
              {"composite": _no_background, "render": _no_background}),
    WrongPort("alpha_gradient_without_rest", "Gradient of alpha without what stands behind",
              "own colour only; right: own minus the rest", {"composite": _own_colour_only}),
    WrongPort("covariance_off_diagonal_half", "Half the off-diagonal gradient", "d/db of one entry; right: of both",
              {"composite": _half_off_diagonal}),
    WrongPort("depth_gradient_dropped", "Depth image sends no gradient to z", "0; right: alpha T",
              {"composite": deviating("drop_depth_to_z"), "render": deviating("drop_depth_to_z"),
               "objective": deviating("drop_depth_to_z")}),
    WrongPort("deviations_off", "Exact gradients in preset legacy", "exact; right: the released code's",
              {"composite": _without_deviations, "render": _without_deviations, "objective": _without_deviations}),
    WrongPort("divide_by_one_minus_alpha", "Reverse pass divides by 1 - alpha", "0 / 0 at alpha = 1; right: recursion",
              {"composite": _division}),
    WrongPort("tiles_from_the_mean", "Tiles counted from the mean", "u; right: u - 1/2",
              {"composite": _tiles(half=0.0)}),
    WrongPort("tiles_root_without_floor", "Radius of the tiles without its floor",
              "max(0, .); right: max(0.1, .)", {"composite": _tiles(floor=0.0)}),
]  # fmt: skip
