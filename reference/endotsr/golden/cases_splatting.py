"""Golden cases of the rasteriser: covariance, projection, harmonics, compositing, the whole render."""

import math
from typing import Any

import numpy as np

from endotsr.golden.cases import Seeds, Spec
from endotsr.golden.generator import Made, changed, given, permutation, single
from endotsr.splatting.settings import EXACT, LEGACY, PAPER, RasterSettings
from endotsr.stages.requests import raster_dict

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


def spread_points(seeds: Seeds, count: int, reach: float = 0.3) -> np.ndarray:
    """Camera-space points at well separated depths whose order is not the index order."""
    z = single(3.0 + 0.35 * permutation(seeds.seed("order"), count))
    u = seeds.uniform("u", -reach, reach, count).array
    v = seeds.uniform("v", -reach, reach, count).array
    return np.stack([u * z, v * z, z])


def _covariance() -> list[Spec]:
    seeds = Seeds("covariance", "generic")
    quaternion = seeds.uniform("quaternion", -2.0, 2.0, 4, 6)
    inputs = {
        "quaternion": quaternion,
        "log_scale": seeds.uniform("log_scale", -1.0, 1.0, 3, 6),
        "d_rotation": seeds.uniform("d_rotation", -1.0, 1.0, 3, 3, 6),
        "d_scale": seeds.uniform("d_scale", -1.0, 1.0, 3, 6),
    }
    flags = ("quaternion_xyzw", "quaternion_not_normalised", "quaternion_gradient_without_norm", "rotation_transposed",
             "scale_gradient_without_scale", "scale_is_variance")  # fmt: skip
    out = [Spec("covariance", "generic", "covariance", "Raw quaternions w, x, y, z of any length", flags, {}, inputs)]
    zero = inputs | {"quaternion": changed(quaternion, (slice(None), 2), 0.0, "quaternion 2 is 0")}
    out.append(Spec("covariance", "zero_quaternion", "covariance", "A zero quaternion is the identity, gradient 0",
                    ("zero_quaternion",), {}, zero, ("quaternion",), own=("rotation",)))  # fmt: skip
    return out


def _projection() -> list[Spec]:
    out = []
    for name, preset in PRESETS.items():
        seeds, cast = Seeds("projection", name), pose()
        points = spread_points(seeds, 12)
        z = points[2]
        points[0, :5] = z[:5] * [1.1, -1.1, 0.1, 0.1, 1.1]
        points[1, :5] = z[:5] * [0.1, 0.1, 1.1, -1.1, 1.1]
        points[2, 5:8] = [-3.0, 0.1875, 0.21875]
        points[:2, 5:8] = 0.03125
        inputs = _shape_inputs(seeds, 12) | {"position": seen_at(points, cast)} | cast
        flags = ("pixel_corner_mean", "low_pass_missing", "near_plane_zero", "pose_inverted", "shape_rotation_ignored",
                 *(("jacobian_clamp_missing",) if name != "exact" else ("jacobian_clamped",)),
                 *(("clamp_term_twice",) if name == "paper" else ()))  # fmt: skip
        title = f"Preset {name}: centres off axis on all sides, behind the camera, just inside the near plane"
        out.append(Spec("projection", name, "projection", title, flags, lens_settings(preset), inputs))
    seeds, cast = Seeds("projection", "needle"), pose()
    inputs = _shape_inputs(seeds, 4) | {"position": seen_at(spread_points(seeds, 4), cast)} | cast
    inputs["scale"] = given(np.array([[20.0] * 4, [1e-3] * 4, [2e-3] * 4]), "20, 1e-3, 2e-3", "scene unit")
    out.append(Spec("projection", "needle", "projection", "Needles: long axes of hundreds of pixels", 
                    ("shape_rotation_ignored",), lens_settings(PAPER), inputs))  # fmt: skip
    return out


def _shape_inputs(seeds: Seeds, count: int) -> dict[str, Made]:
    from endotsr.splatting.covariance import covariance_forward

    quaternion = seeds.uniform("quaternion", -1.0, 1.0, 4, count).array
    rotation = covariance_forward(quaternion, np.zeros((3, count)))[0].rotation
    return {
        "rotation": given(rotation, f"R of uniform(-1, 1) quaternions, seed {seeds.seed('quaternion')}"),
        "scale": seeds.uniform("scale", 0.2, 1.0, 3, count, unit="scene unit"),
        "d_mean2d": seeds.uniform("d_mean2d", -1.0, 1.0, 2, count, unit="loss per px"),
        "d_covariance2d": seeds.uniform("d_covariance2d", -1.0, 1.0, 3, count, unit="loss per px^2"),
        "d_depth": seeds.uniform("d_depth", -1.0, 1.0, count, unit="loss per scene unit"),
    }


def lens_settings(raster: RasterSettings, **more: Any) -> dict[str, Any]:
    """Rasteriser and lens as settings."""
    return {"raster": raster_dict(raster), "camera": LENS} | more


def _harmonics() -> list[Spec]:
    out = []
    for degree in range(4):
        seeds = Seeds("harmonics", f"degree_{degree}")
        coefficients = seeds.uniform("harmonics", -0.4, 0.6, (degree + 1) ** 2, 3, 9)
        coefficients = changed(coefficients, (0, slice(None), slice(None, None, 3)), -4.0, "[0, :, ::3] is -4: clamped")
        coefficients = changed(coefficients, (0, 1, slice(1, None, 3)), 4.0, "[0, 1, 1::3] is 4: above 1")
        inputs = {
            "harmonics": coefficients,
            "residual": seeds.uniform("residual", -0.3, 0.3, 3, 9),
            "position": seeds.uniform("position", -2.0, 2.0, 3, 9, unit="scene unit"),
            "centre": seeds.uniform("centre", -0.3, 0.3, 3, unit="scene unit"),
            "d_colour": seeds.uniform("d_colour", -1.0, 1.0, 3, 9),
        }
        flags = ["colour_not_clamped", "colour_clamped_above", "offset_half_missing", "residual_not_scaled"]
        if degree > 0:
            flags += ["harmonics_sign_y", "direction_gradient_dropped", "direction_inverted", "bands_channel_first"]
        title = f"Real harmonics of degree {degree}; residual on the first coefficient, clamp at 0, none above"
        out.append(Spec("harmonics", f"degree_{degree}", "harmonics", title, tuple(flags), {"degree": degree}, inputs))
    return out


WIDTH, HEIGHT = 18, 13


def screen_inputs(seeds: Seeds, count: int, low: float, high: float) -> dict[str, Made]:
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


def logit_of(opacity: list[float]) -> Made:
    """Logits of opacities."""
    values = np.array(opacity)
    return given(np.log(values) - np.log1p(-values), "logit of " + ", ".join(f"{v:.6g}" for v in opacity))


def _size() -> dict[str, int]:
    return {"width": WIDTH, "height": HEIGHT}


def _composite() -> list[Spec]:
    out = []
    common = ("order_by_index", "order_reversed", "depth_over_opacity", "background_missing", "pixel_corner_sample",
              "depth_gradient_dropped", "alpha_gradient_without_rest", "covariance_off_diagonal_half")  # fmt: skip
    for name, preset in PRESETS.items():
        inputs = screen_inputs(Seeds("composite", name), 8, 4.0, 90.0)
        flags = common if name != "legacy" else tuple(f for f in common if f != "depth_gradient_dropped")
        title = f"Preset {name}: overlapping Gaussians, depth order unlike index order"
        out.append(
            Spec("composite", name, "composite", title, flags, {"raster": raster_dict(preset)} | _size(), inputs)
        )
    wide = given(np.array([[4e6] * 5, [0.0] * 5, [4e6] * 5]), "a = c = 4e6, b = 0: flat over the image", "px^2")
    paper = {"raster": raster_dict(PAPER)} | _size()

    def flat(case: str, title: str, opacity: list[float], depth: list[float], flags: tuple[str, ...], still=(),
             without=()) -> Spec:  # fmt: skip
        inputs = screen_inputs(Seeds("composite", case), 5, 4.0, 90.0)
        inputs |= {"covariance2d": wide, "opacity_logit": logit_of(opacity)}
        inputs["depth"] = given(depth, ", ".join(map(str, depth)), "scene unit")
        return Spec("composite", case, "composite", title, flags, paper, inputs, still, without)

    cut = 1 / 255
    out.append(flat("alpha_cutoff", "Alpha a thousandth below and above 1/255", [cut * 0.999, cut * 1.001, cut * 0.998,
                    cut * 1.002, 0.3], [3.0, 4.0, 5.0, 6.0, 7.0], ("cutoff_missing", "cutoff_1_over_256")))  # fmt: skip
    out.append(flat("alpha_clamp", "Alpha below, at and above 0.99: gradient 0 where clamped",
                    [0.9895, 0.99002, 0.9985, 0.5, 0.9999], [7.0, 6.0, 5.0, 3.0, 4.0],
                    ("alpha_clamp_999", "alpha_clamp_missing", "clamped_alpha_gradient")))  # fmt: skip
    out.append(flat("transmittance_stop", "Stop before T falls below 1e-4, not after", [0.98, 0.98, 0.7, 0.1, 0.9],
                    [3.0, 4.0, 5.0, 6.0, 7.0], ("stop_missing", "stop_after", "stop_at_1e-3"), (),
                    ("d_mean2d", "d_covariance2d")))  # fmt: skip
    out.append(flat("equal_depths", "Equal depths keep the order of the index", [0.3, 0.4, 0.5, 0.6, 0.7],
                    [4.0, 4.0, 3.0, 4.0, 4.0], ("ties_reversed",), ("depth",)))  # fmt: skip
    inputs = screen_inputs(Seeds("composite", "opaque_exact"), 4, 1.0, 4.0)
    inputs["opacity_logit"] = given([40.0, -40.0, 2.0, 40.0], "40, -40, 2, 40")
    inputs["covariance2d"] = given(
        np.array([[1e12, 9.0, 9.0, 9.0], [0.0] * 4, [1e12, 9.0, 9.0, 9.0]]), "a = c = 1e12, 9, 9, 9; b = 0", "px^2"
    )
    inputs["depth"] = given([4.0, 5.0, 3.0, 6.0], "4, 5, 3, 6", "scene unit")
    out.append(Spec("composite", "opaque_exact", "composite", "Alpha of 1 in front: no division by 1 - alpha",
                    ("divide_by_one_minus_alpha",), {"raster": raster_dict(EXACT)} | _size(), inputs,
                    without=("d_background",)))  # fmt: skip
    inputs = screen_inputs(Seeds("composite", "on_the_cutoff"), 5, 4.0, 6.0)
    middles = [[2.5, 6.5, 9.5, 13.5, 16.5], [3.5, 9.5, 5.5, 10.5, 2.5]]
    inputs |= {"mean2d": given(middles, "pixel centres", "px"), "opacity_logit": logit_of([cut] * 5)}
    reverse = tuple(
        f"d_{name}" for name in ("mean2d", "covariance2d", "opacity_logit", "colour", "depth", "background")
    )
    out.append(Spec("composite", "on_the_cutoff", "composite", "Peaks of alpha at 1/255: each may be drawn or not",
                    ("cutoff_missing",), paper, inputs, ("opacity_logit", "mean2d", "covariance2d"),
                    reverse, 5))  # fmt: skip
    return [*out, _one_on_the_cutoff(paper)]


def _one_on_the_cutoff(settings: dict[str, Any]) -> Spec:
    """One decision that rounding may take either way, and with it the whole answer, gradients included."""
    inputs = screen_inputs(Seeds("composite", "one_on_the_cutoff"), 3, 4.0, 90.0)
    inputs["mean2d"] = changed(inputs["mean2d"], (slice(None), 1), [9.5, 6.5], "[:, 1] is (9.5, 6.5), a pixel centre")
    inputs["covariance2d"] = changed(
        inputs["covariance2d"], (slice(None), 1), [1.5, 0.25, 2.0], "[:, 1] is 1.5, 0.25, 2"
    )
    inputs["opacity_logit"] = changed(
        inputs["opacity_logit"], 1, -math.log(254.0), "[1] is -log 254, rounded: opacity 1/255 - 7e-10"
    )
    drawn = settings | {"raster": settings["raster"] | {"alpha_cutoff": (1 - 1e-5) / 255}}
    title = "One peak of alpha at 1/255: drawn or not, but the same in image and gradient"
    return Spec("composite", "one_on_the_cutoff", "composite", title, ("cutoff_decided_twice",), settings, inputs,
                ("opacity_logit", "mean2d", "covariance2d"), either=(drawn,))  # fmt: skip


def scene_inputs(seeds: Seeds, count: int, degree: int, cast: dict[str, Made], small: float = -1.2) -> dict[str, Made]:
    """Raw parameters of overlapping Gaussians in view of a camera."""
    quaternion = seeds.uniform("quaternion", -1.0, 1.0, 4, count)
    harmonics = seeds.uniform("harmonics", -0.25, 0.25, (degree + 1) ** 2, 3, count)
    first = harmonics.array[0] * 3 + 0.5
    return {
        "position": seen_at(spread_points(seeds, count, 0.4), cast),
        "quaternion": changed(quaternion, 0, quaternion.array[0] + 1.5, "w plus 1.5"),
        "log_scale": seeds.uniform("log_scale", small, 0.2, 3, count),
        "opacity_logit": seeds.uniform("opacity_logit", -1.5, 3.0, count),
        "harmonics": changed(harmonics, 0, first, "[0] times 3 plus 0.5"),
    } | cast


def cotangents(seeds: Seeds) -> dict[str, Made]:
    """Given derivatives by the images, and a background."""
    height, width = LENS["height"], LENS["width"]
    return {
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
        "d_colour_image": seeds.uniform("d_colour_image", -1.0, 1.0, 3, int(height), int(width)),
        "d_depth_image": seeds.uniform("d_depth_image", -1.0, 1.0, int(height), int(width)),
        "d_opacity_image": seeds.uniform("d_opacity_image", -1.0, 1.0, int(height), int(width)),
    }


def _render() -> list[Spec]:
    out = []
    shared = ("pixel_corner_camera", "low_pass_missing", "quaternion_xyzw", "pose_inverted")
    rows: list[tuple[str, RasterSettings, int, bool, str, tuple[str, ...]]] = [
        ("exact", EXACT, 3, False, "The definition: every Gaussian at every pixel", ("cutoff_added",)),
        (
            "paper",
            PAPER,
            3,
            False,
            "The shared semantics, moving camera",
            ("cutoff_missing", "depth_gradient_dropped", "screen_gradient_in_ndc"),
        ),
        ("legacy", LEGACY, 3, False, "The released code's support and gradients", ("deviations_off",)),
        *((f"paper_degree_{d}", PAPER, d, True, f"Degree {d}, static camera at the origin", ()) for d in range(3)),
    ]
    for case, preset, degree, static, title, flags in rows:
        seeds, cast = Seeds("render", case), pose(static)
        inputs = scene_inputs(seeds, 12, degree, cast) | cotangents(seeds)
        inputs["residual"] = seeds.uniform("residual", -0.2, 0.2, 3, 12)
        if static:
            shared_here = tuple(f for f in shared if f != "pose_inverted")
        else:
            shared_here = shared
        settings = lens_settings(preset, degree=degree)
        out.append(Spec("render", case, "render", title, shared_here + flags, settings, inputs, without=("visible",)))
    return out + _hard_renders()


def _hard_renders() -> list[Spec]:
    out = []

    def add(case: str, title: str, flags: tuple[str, ...], change, still=(), own=()):
        seeds, cast, count = Seeds("render", case), pose(static=True), 8
        inputs = scene_inputs(seeds, count, 1, cast) | cotangents(seeds)
        inputs["residual"] = seeds.uniform("residual", -0.2, 0.2, 3, count)
        change(inputs, seeds)
        settings = lens_settings(PAPER, degree=1)
        out.append(Spec("render", case, "render", title, flags, settings, inputs, still, ("visible",), own=own))

    def near(inputs, seeds):
        z = [0.1984375, 0.2015625, -2.0, 0.0]
        position = changed(inputs["position"], (2, slice(0, 4)), z, "z of 0..3 is 0.198, 0.202, -2, 0")
        inputs["position"] = changed(position, (slice(0, 2), slice(0, 4)), 0.015625, "x, y of 0..3 are 1/64")
        inputs["log_scale"] = changed(inputs["log_scale"], (slice(None), slice(0, 4)), [[-4.0], [-4.5], [-5.0]],
                                      "0..3 are -4, -4.5, -5")  # fmt: skip

    add("near_plane", "z just below and above the near plane, behind, and 0", ("near_plane_zero",), near)

    def needle(inputs, seeds):
        inputs["log_scale"] = changed(inputs["log_scale"], (slice(None), slice(0, 3)), [[1.5], [-7.0], [-6.0]],
                                      "0..2 are 1.5, -7, -6")  # fmt: skip

    add("needle", "Needles of forty pixels and a thousandth of one", ("low_pass_missing",), needle)

    def zero(inputs, seeds):
        inputs["quaternion"] = changed(inputs["quaternion"], (slice(None), 4), 0.0, "quaternion 4 is 0")

    add("zero_quaternion", "A zero quaternion renders as the identity", ("zero_quaternion",), zero, ("quaternion",),
        ("colour_image", "depth_image", "opacity_image"))  # fmt: skip

    def ties(inputs, seeds):
        inputs["position"] = changed(inputs["position"], 2, 4.0, "z is 4 for all")

    add("equal_depths", "All at one depth: index order", ("ties_reversed",), ties,
        ("position", "rotation_matrix", "translation"))  # fmt: skip

    def far(inputs, seeds):
        position = changed(inputs["position"], 0, inputs["position"].array[2] * 1.5, "x = 1.5 z")
        inputs["position"] = position
        inputs["log_scale"] = changed(inputs["log_scale"], ..., inputs["log_scale"].array + 1.25, "log-scale plus 1.25")

    add(
        "off_axis", "Every centre beyond the limit of the Jacobian", ("jacobian_clamp_missing", "clamp_term_twice"), far
    )

    def empty(inputs, seeds):
        for name in ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual"):
            inputs[name] = given(inputs[name].array[..., :0], "no Gaussian", inputs[name].unit)

    add("no_gaussian", "No Gaussian: the background", ("background_missing",), empty)
    return out


def cases() -> list[Spec]:
    """All of them."""
    return [*_covariance(), *_projection(), *_harmonics(), *_composite(), *_render()]
