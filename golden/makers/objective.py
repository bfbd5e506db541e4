"""Families `objective` and `determinism`: the loss of one view (6) with every term and every gradient.

Inputs: a moving scene, an observed image with mask, prior depth and edges, and the weights of the terms. The cases are
the presets, the other up-sampling rule, a pyramid level without valid pixels, and a rigid scene without components.
`determinism` requests the same objective twice: the results must be bitwise equal.
"""

from collections.abc import Callable

import numpy as np

from endotsr.port.operations.requests import raster_dict
from endotsr.port.operations.scene import TWICE
from endotsr.training.scene.gaussians import Gaussians
from makers.images import tissue
from makers.making import Made, Seeds, Spec, changed, given
from makers.moving import LENS, TIME, model_settings, moving_inputs
from makers.operations import PER_DISPLAY, PER_LENGTH, Declared, Judged
from makers.views import PRESETS

GRADIENT_UNITS = {"position": PER_LENGTH, "motion_coefficients": PER_LENGTH}
DECLARED = {
    "objective": Declared(
        {
            "colour_image": Judged(3, "display", oracle="render.render_forward"),
            "depth_image": Judged(3, "scene unit", oracle="render.render_forward"),
            "term_l1": Judged(3, "display", oracle="masked_l1.masked_l1_forward"),
            "term_ssim": Judged(3, oracle="masked_ssim.masked_ssim_forward"),
            "term_depth": Judged(3, oracle="depth.normalised_depth_forward"),
            "term_smoothness": Judged(3, "scene unit^2", oracle="smoothness.smoothness_forward"),
            "term_laplacian": Judged(3, "display", oracle="laplacian.laplacian_loss_forward"),
            "term_penalty": Judged(3, "scene unit^2", oracle="matern.matern_penalty_forward"),
            "objective": Judged(3, "loss", oracle="masked_l1.masked_l1_forward"),
            **{f"d_{name}": Judged(3, GRADIENT_UNITS.get(name, "loss"), "last") for name in Gaussians._fields},
            "d_exposure_log_gain": Judged(3, "loss"),
            "d_exposure_bias": Judged(3, PER_DISPLAY),
        },
        "`scene`, `render` on black, then (1 - w) L1 + w (1 - SSIM) + depth + smoothness + lambda_lap Laplacian (all"
        " weights in `loss`) + lambda_msp penalty. Terms are unweighted; `term_ssim` is the mean SSIM itself, not"
        " 1 - SSIM. There is no schedule: every weight in `loss` applies. An input that is absent is a component that"
        " is off; without `model.laplacian` there is no Laplacian term. With `exposure_log_gain` and `exposure_bias`,"
        " those of this frame, every term reads the exposed render (B13), and so does `colour_image`",
    ),
    "determinism": Declared(
        {
            **{f"{name}_1": Judged(5, "loss") for name in TWICE},
            **{f"{name}_2": Judged(5, "loss", f"identical {name}_1") for name in TWICE},
        },
        "`objective` computed twice by two separate passes: `_1` and `_2` must have the same bits",
    ),
}
OPERATIONS = tuple(DECLARED)
HEIGHT, WIDTH = int(LENS["height"]), int(LENS["width"])
WEIGHTS = {
    "ssim_weight": 0.25, "depth_weight": 1.0, "smoothness_weight": 0.05, "total_variation_factor": 2.0,
    "lambda_msp": 1.0, "lambda_lap": 0.75, "upsampling": "co_sited",
}  # fmt: skip


def image_inputs(seeds: Seeds) -> dict[str, Made]:
    """An observed frame with mask, prior depth and edges."""
    edges = np.zeros((HEIGHT, WIDTH), bool)
    edges[2 : HEIGHT - 2, 9] = True
    prior = seeds.uniform("prior_depth", 2.0, 7.0, HEIGHT, WIDTH, unit="scene unit")
    return {
        "observed": seeds.uniform("observed", 0.0, 1.0, 3, HEIGHT, WIDTH, unit="display"),
        "mask": tissue(HEIGHT, WIDTH, 4, 5),
        "prior_depth": changed(prior, ([8, 9], [8, 3]), 0.0, "(8, 8) and (9, 3) are 0: no depth"),
        "edges": given(edges, f"True in column 9, rows 2..{HEIGHT - 3}"),
    }


def _spec(
    case: str,
    preset: str,
    title: str,
    flags: tuple[str, ...],
    degree: int = 3,
    static: bool = False,
    *,
    family: str = "objective",
    basis: str = "quartic",
    upsampling: str = "co_sited",
    change: Callable[[dict[str, Made]], None] | None = None,
) -> Spec:
    seeds = Seeds(family, case)
    inputs = moving_inputs(seeds, degree, static) | image_inputs(seeds)
    if change:
        change(inputs)
    settings = {
        "t": TIME,
        "degree": degree,
        "camera": LENS,
        "preset": preset,
        "raster": raster_dict(PRESETS[preset]),
        "model": model_settings(basis=basis),
        "loss": WEIGHTS | {"upsampling": upsampling},
    }
    return Spec(family, case, family, title, flags, settings, inputs)


def _bright(inputs: dict[str, Made]) -> None:
    h = inputs["harmonics"]
    inputs["harmonics"] = changed(h, (0, 0), h.array[0, 0] + 3.0, "[0, 0] plus 3: red above 1")


def _empty_level(inputs: dict[str, Made]) -> None:
    inputs["mask"] = tissue(HEIGHT, WIDTH, 11, 13)


def _bare(inputs: dict[str, Made]) -> None:
    for name in ("fdm_weight", "fdm_centre", "fdm_width", "appearance_coefficients", "motion_coefficients"):
        del inputs[name]


def cases() -> list[Spec]:
    """Presets, hard masks, a rigid scene; then the same request twice."""
    terms = ("depth_term_dropped", "laplacian_term_dropped", "penalty_dropped", "ssim_term_dropped",
             "ssim_sign", "smoothness_dropped", "upsampling_swapped", "photometric_of_clamped_render",
             "laplacian_gradient_dropped", "depth_loss_gradient_dropped", "penalty_gradient_dropped",
             "deformation_of_position_only", "residual_gradient_unscaled", "statistics_over_all_frames",
             "pixel_corner_camera", "l1_not_reduced", "motion_gradient_dropped")  # fmt: skip
    dim = tuple(term for term in terms if term != "photometric_of_clamped_render")
    return [
        _spec("paper", "paper", "Preset paper, every component, moving camera", terms, change=_bright),
        _spec("exact", "exact", "Preset exact, every component", dim, basis="gaussian"),
        _spec("legacy", "legacy", "Preset legacy: the released code's gradients", ("deviations_off",)),
        _spec("half_pixel", "paper", "The other up-sampling, degree 1, static camera", ("upsampling_swapped",),
              1, True, upsampling="half_pixel"),
        _spec("empty_level", "paper", "The mask leaves no valid pixel at level 3", ("empty_level_rescaled",),
              1, True, change=_empty_level),
        _spec("base_model", "paper", "No component A, S, no deformation: a rigid scene", (), 2, True, change=_bare),
        _spec("twice", "paper", "The same request twice gives the same bits", ("sums_in_any_order",),
              family="determinism"),
    ]  # fmt: skip
