"""Golden cases of rules at the edge of their range: values under the mask, decisions on a threshold, needles, clips.

They belong to the families of the stages; a port that breaks one of these rules passes all generic cases.
"""

import msgspec
import numpy as np

from endotsr.config import DensityConfig
from endotsr.golden.cases import Seeds, Spec
from endotsr.golden.cases_equations import omegas, scalar, tissue
from endotsr.golden.cases_losses import HEIGHT, WIDTH, tool_mask
from endotsr.golden.cases_splatting import (
    LENS,
    cotangents,
    lens_settings,
    logit_of,
    pose,
    raster_dict,
    scene_inputs,
    screen_inputs,
)
from endotsr.golden.generator import Made, changed, given
from endotsr.splatting.settings import LEGACY, PAPER


def _spoiled(made: Made, mask: Made) -> Made:
    """Not a number at excluded pixels, infinite at every other one of them."""
    holes = np.where(np.arange(mask.array.size).reshape(mask.array.shape) % 2 > 0, np.inf, np.nan)
    values = np.where(mask.array, made.array, holes)
    return changed(made, ..., values, "where the mask is False: NaN at even pixels, infinity at odd ones, "
                   "counted row by row from 0")  # fmt: skip


def _under_the_mask() -> list[Spec]:
    out = []
    for family, up in (("masked_l1", "d_loss"), ("masked_ssim", "d_ssim")):
        seeds, mask = Seeds(family, "not_finite_under_mask"), tool_mask()
        images = {n: seeds.uniform(n, 0.0, 1.0, 3, HEIGHT, WIDTH, unit="display") for n in ("rendered", "observed")}
        inputs = {name: _spoiled(made, mask) for name, made in images.items()} | {"mask": mask, up: scalar(1.25)}
        out.append(Spec(family, "not_finite_under_mask", family, "NaN and infinity under the mask change nothing",
                        ("mask_multiplied",), {}, inputs))  # fmt: skip
    seeds, mask = Seeds("laplacian", "not_finite_under_mask"), tissue(19, 22, 2, 3)
    images = {n: seeds.uniform(n, 0.0, 1.0, 3, 19, 22, unit="display") for n in ("rendered", "observed")}
    inputs = {name: _spoiled(made, mask) for name, made in images.items()} | {"mask": mask, "d_loss": scalar(0.75)}
    out.append(Spec("laplacian", "not_finite_under_mask", "laplacian", "NaN and infinity under the mask change nothing",
                    ("mask_multiplied",), {"upsampling": "co_sited", "levels": 3},
                    inputs, without=("band_1", "band_2", "band_3")))  # fmt: skip
    return out


def _depth() -> list[Spec]:
    def spec(case: str, title: str, flags: tuple[str, ...], **change: Made) -> Spec:
        seeds = Seeds("normalised_depth", case)
        inputs = {
            "rendered_depth": seeds.uniform("rendered_depth", 30.0, 70.0, HEIGHT, WIDTH, unit="scene unit"),
            "prior_depth": seeds.uniform("prior_depth", 40.0, 55.0, HEIGHT, WIDTH, unit="scene unit"),
            "mask": tool_mask(), "d_loss": scalar(1.5),
        }  # fmt: skip
        return Spec("normalised_depth", case, "normalised_depth", title, flags, {}, inputs | change)

    seeds = Seeds("normalised_depth", "not_finite")
    prior = seeds.uniform("prior_depth", 40.0, 55.0, HEIGHT, WIDTH, unit="scene unit")
    prior = changed(prior, ([0, 6], [3, 9]), [np.inf, np.nan], "(0, 3) is infinite, (6, 9) is NaN: no depth")
    depth = _spoiled(seeds.uniform("rendered_depth", 30.0, 70.0, HEIGHT, WIDTH, unit="scene unit"), tool_mask())
    few = Seeds("normalised_depth", "ten_priors")
    keep = np.zeros((HEIGHT, WIDTH))
    keep[6, :10] = few.uniform("prior_depth", 40.0, 55.0, HEIGHT, WIDTH).array[6, :10]
    ten = few.uniform("prior_depth", 40.0, 55.0, HEIGHT, WIDTH, unit="scene unit")
    return [
        spec("not_finite", "Priors that are not finite are none; the largest depth is that of finite values",
             ("mask_multiplied", "infinite_prior_counts"), prior_depth=prior, rendered_depth=depth),
        spec("ten_priors", "Ten priors are enough", ("ten_priors_ignored",),
             prior_depth=changed(ten, ..., keep, "0 but row 6, columns 0..9")),
        spec("nothing_rendered", "Nothing rendered: 0, no division by the largest depth", ("depth_over_zero",),
             rendered_depth=given(np.zeros((HEIGHT, WIDTH)), "0", "scene unit")),
    ]  # fmt: skip


def _stages() -> list[Spec]:
    seeds = Seeds("atoms", "repeated_stamps")
    times = np.arange(16) // np.array([1, 2])[np.arange(16) % 2] / 16
    inputs = {
        "times": given(times, "k / 16 for even k, floor(k / 2) / 16 for odd k"),
        "train_index": given(np.arange(16), "all", "frame"),
        "omega": omegas(3, 5.0),
        "phi": seeds.uniform("phi", -1.0, 1.0, 6),
        "d_phi_bar": seeds.uniform("d_phi_bar", -1.0, 1.0, 6),
    }
    out = [Spec("atoms", "repeated_stamps", "atoms", "A stamp that is repeated counts once",
                ("repeated_stamps_counted",), {}, inputs, ("times",))]  # fmt: skip
    seeds = Seeds("covariance", "clipped_log_scale")
    inputs = {
        "quaternion": seeds.uniform("quaternion", -2.0, 2.0, 4, 4),
        "log_scale": given([[60.0, 1.0, -60.0, 41.0], [2.0, -41.0, 1.0, 39.0], [0.5, 3.0, -2.0, -39.0]],
                           "(60, 2, 1/2), (1, -41, 3), (-60, 1, -2), (41, 39, -39)"),
        "d_rotation": seeds.uniform("d_rotation", -1.0, 1.0, 3, 3, 4),
        "d_scale": seeds.uniform("d_scale", -1.0, 1.0, 3, 4),
    }  # fmt: skip
    out.append(Spec("covariance", "clipped_log_scale", "covariance", "A log-scale is clipped to +-40, gradient 0",
                    ("log_scale_not_clipped",), {}, inputs))  # fmt: skip
    seeds = Seeds("harmonics", "at_the_camera")
    centre = seeds.uniform("centre", -0.3, 0.3, 3, unit="scene unit")
    position = seeds.uniform("position", -2.0, 2.0, 3, 4, unit="scene unit")
    inputs = {
        "harmonics": seeds.uniform("harmonics", -0.4, 0.6, 9, 3, 4),
        "residual": seeds.uniform("residual", -0.3, 0.3, 3, 4),
        "position": changed(position, (slice(None), 1), centre.array, "Gaussian 1 is at the optical centre"),
        "centre": centre,
        "d_colour": seeds.uniform("d_colour", -1.0, 1.0, 3, 4),
    }
    out.append(Spec("harmonics", "at_the_camera", "harmonics", "A Gaussian at the optical centre: the first band only",
                    ("direction_of_nothing",), {"degree": 2}, inputs, ("position", "centre"),
                    own=("colour",)))  # fmt: skip
    return [*out, _zero_moment()]


def _zero_moment() -> Spec:
    seeds = Seeds("adam", "zero_moment")
    gradients = seeds.uniform("gradients", -1.0, 1.0, 2, 3, 4)
    gradients = changed(gradients, (slice(None), 1), 0.0, "[:, 1] is 0: both moments are 0")
    gradients = changed(gradients, (0, 2), 0.0, "[0, 2] is 0: the moments begin at the second step")
    inputs = {"parameter": seeds.uniform("parameter", -1.0, 1.0, 3, 4), "gradients": gradients}
    settings = {"rate": 0.005, "beta1": 0.9, "beta2": 0.999, "epsilon": 1e-15}
    return Spec("adam", "zero_moment", "adam", "A second moment of 0 moves nothing", ("adam_zero_over_zero",),
                settings, inputs)  # fmt: skip


def _density() -> Spec:
    """Opacity 1/2 at a prune threshold of 1/2, largest axis 1 at a limit of 1: neither is beyond."""
    seeds, count = Seeds("density", "on_the_thresholds"), 6
    noise, turned = seeds.uniform("split_noise", -1.5, 1.5, 2, 3, count), pose()["rotation_matrix"]
    logit = seeds.uniform("opacity_logit", 0.5, 2.0, count)
    scale = seeds.uniform("log_scale", -2.0, -0.5, 3, count)
    inputs = {
        "position": seeds.uniform("position", -2.0, 2.0, 3, count, unit="scene unit"),
        "quaternion": seeds.uniform("quaternion", -1.0, 1.0, 4, count),
        "log_scale": changed(scale, (0, slice(1, 4)), [0.0, 0.0, 0.25], "[0, 1:4] is 0, 0, 1/4"),
        "opacity_logit": changed(logit, slice(0, 2), 0.0, "[0:2] is 0: opacity 1/2, the prune threshold"),
        "d_mean2d": given(np.stack([np.full((2, count), 2.0**-4), np.full((2, count), 2.0**-5)]),
                          "1/16 in view 0, 1/32 in view 1", "loss per px"),
        "visible": given(np.ones((2, count), bool), "all True"),
        "split_noise": noise,
        "rotation_matrices": given(np.stack([turned.array] * 2), f"{turned.recipe} for all"),
        "translations": given(np.zeros((2, 3)), "0"),
    }  # fmt: skip
    config = DensityConfig(gradient_threshold=0.25, extent=4.0, dense_fraction=0.25, prune_opacity=0.5)
    settings = {"width": 24, "height": 10, "density": msgspec.to_builtins(config)}
    flags = ("prune_at_the_threshold", "split_at_the_limit", "density_width_for_height")
    return Spec("density", "on_the_thresholds", "density", "On the prune threshold it stays, on the size limit it is "
                "cloned; W of x and H of y", flags, settings, inputs, ("log_scale", "opacity_logit"))  # fmt: skip


def _size_of(inputs: dict[str, Made]) -> dict[str, int]:
    height, width = inputs["d_depth_image"].array.shape
    return {"width": width, "height": height}


def _clamp() -> Spec:
    inputs = screen_inputs(Seeds("composite", "legacy_clamp"), 5, 60.0, 400.0)
    inputs["opacity_logit"] = logit_of([0.9999, 0.995, 0.9, 0.999, 0.5])
    return Spec("composite", "legacy_clamp", "composite", "Preset legacy: the gradient passes the clamp of alpha",
                ("clamp_blocks_legacy",), {"raster": raster_dict(LEGACY)} | _size_of(inputs), inputs)  # fmt: skip


def _stop() -> Spec:
    """Five Gaussians, flat over the image, in the order of the index; the third stops every pixel."""
    inputs = screen_inputs(Seeds("composite", "stop_ends_pixel"), 5, 4.0, 90.0)
    wide = np.array([[4e6] * 5, [0.0] * 5, [4e6] * 5])
    inputs |= {
        "covariance2d": given(wide, "a = c = 4e6, b = 0: flat over the image", "px^2"),
        "opacity_logit": logit_of([0.98, 0.98, 0.9, 0.5, 0.1]),
        "depth": given([3.0, 4.0, 5.0, 6.0, 7.0], "3, 4, 5, 6, 7", "scene unit"),
    }
    title = "A weak Gaussian behind the one that stops is not drawn"
    return Spec("composite", "stop_ends_pixel", "composite", title, ("stop_skips",),
                {"raster": raster_dict(PAPER)} | _size_of(inputs), inputs,
                without=("d_mean2d", "d_covariance2d"))  # fmt: skip


def _tiles() -> Spec:
    """Discs whose radius or centre puts the end of their tiles between the right rule and a wrong one."""
    seeds, (width, height) = Seeds("composite", "tiles"), (48, 20)
    images = {n: seeds.uniform(n, -1.0, 1.0, *([3] if "colour" in n else []), height, width)
              for n in ("d_colour_image", "d_depth_image", "d_opacity_image")}  # fmt: skip
    size = [99.9, 99.9, 4.0]
    inputs = {
        "mean2d": given([[46.75, 47.25, 24.3], [8.2, 11.7, 10.25]], "(46.75, 8.2), (47.25, 11.7), (24.3, 10.25)", "px"),
        "covariance2d": given([size, [0.0] * 3, size], "a = c = 99.9, 99.9, 4; b = 0", "px^2"),
        "opacity_logit": logit_of([0.95, 0.9, 0.97]),
        "colour": seeds.uniform("colour", 0.1, 1.0, 3, 3, unit="display"),
        "depth": given([5.0, 4.0, 3.0], "5, 4, 3", "scene unit"),
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
    } | images
    settings = {"raster": raster_dict(LEGACY), "width": width, "height": height}
    return Spec("composite", "tiles", "composite", "Where the tiles of a Gaussian end: centre less half a pixel, the "
                "root at least 0.1", ("tiles_from_the_mean", "tiles_root_without_floor"), settings, inputs)  # fmt: skip


def _needles() -> Spec:
    """A needle of three thousand pixels across the image, and two whose centres lie a thousand outside."""
    seeds, cast, count = Seeds("render", "long_needle"), pose(static=True), 3
    angle, along = np.array([0.7, 2.2, -0.4]), np.array([0.0, 260.0, -300.0])
    axis = np.stack([np.cos(angle), np.sin(angle), 0 * angle])
    middle = np.array([[0.1, -0.3, 0.2], [-0.2, 0.1, 0.4], [4.0, 4.5, 5.0]])
    turn = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)])
    inputs = scene_inputs(seeds, count, 0, cast) | cotangents(seeds)
    inputs |= {
        "position": given(middle + along * axis, "(0.1, -0.2, 4), (-0.3, 0.1, 4.5), (0.2, 0.4, 5) plus (0, 260, -300) "
                          "(cos a, sin a, 0), a = 0.7, 2.2, -0.4", "scene unit"),
        "quaternion": given(turn, "(cos a/2, 0, 0, sin a/2)"),
        "log_scale": given([[6.5] * 3, [-7.0] * 3, [-7.0] * 3], "6.5, -7, -7"),
        "opacity_logit": given([2.0, 1.0, 0.5], "2, 1, 1/2"),
        "residual": seeds.uniform("residual", -0.2, 0.2, 3, count),
    }  # fmt: skip
    flags = ("determinant_cancels", "distance_cancels")
    shape = ("d_position", "d_quaternion", "d_log_scale", "d_mean2d", "d_rotation_matrix", "d_translation")
    return Spec("render", "long_needle", "render", "Needles of 3000 px keep their digits in float32", flags,
                lens_settings(PAPER, degree=0), inputs,
                without=("visible", *shape))  # fmt: skip


def _out_of_view() -> Spec:
    """In view; beside the image, near and far; behind; too faint; between the pixel centres."""
    seeds, cast, count = Seeds("render", "visits"), pose(static=True), 8
    inputs = scene_inputs(seeds, count, 0, cast) | cotangents(seeds)
    u = np.array([8.25, -2.0, -30.0, 10.0, 23.5, 9.0, 7.0, 12.0])
    v = np.array([9.5, 6.0, 8.0, 40.0, 4.0, 9.0, 8.0, 7.0])
    z = np.array([4.0, 5.0, 3.0, 6.0, 3.5, -2.0, 4.5, 5.5])
    place = [(u - LENS["cx"]) / LENS["fx"] * z, (v - LENS["cy"]) / LENS["fy"] * z, z]
    text = "; ".join(f"{name} = {', '.join(map(str, values.tolist()))}" for name, values in zip("uvz", (u, v, z)))
    logits = logit_of([0.8, 0.7, 0.9, 0.9, 0.8, 0.9, 0.0045, 0.003])
    inputs |= {
        "position": given(np.stack(place), f"seen at {text}", "scene unit"),
        "log_scale": given([[-1.0] * 6 + [-7.0, -1.0]] * 3, "-1, that of 6 is -7"),
        "opacity_logit": logits,
        "residual": seeds.uniform("residual", -0.2, 0.2, 3, count),
    }
    return Spec("render", "visits", "render", "Which Gaussians the statistic of density control counts as visible",
                ("visible_if_in_front",), lens_settings(PAPER, degree=0), inputs)  # fmt: skip


def cases() -> list[Spec]:
    """All of them."""
    return [
        *_under_the_mask(),
        *_depth(),
        *_stages(),
        _density(),
        _stop(),
        _clamp(),
        _tiles(),
        _needles(),
        _out_of_view(),
    ]
