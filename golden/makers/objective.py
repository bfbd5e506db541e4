"""Families `objective` and `determinism`: the loss of one view (6) with every term and every gradient.

A moving scene, an observed image with mask, prior depth and edges, and the weights of the terms come in. The cases are
the presets, the other up-sampling rule, a pyramid level without valid pixels, and a rigid scene without components.
`determinism` requests the same objective twice: the bits must be equal.
"""

from collections.abc import Callable

import numpy as np

from endotsr.stages.requests import raster_dict
from makers.images import tissue
from makers.making import Made, Seeds, Spec, changed, given
from makers.moving import LENS, TIME, model_settings, moving_inputs
from makers.views import PRESETS
from makers.wrong import edit, port

OPERATIONS = ("objective", "determinism")
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


# ---- mistakes ----

SOURCE, VIEW, SCENE = "fitting.objective", "fitting.view", "stages.scene"
BOTH = "objective training"


WRONG_PORTS = [
    port(
        "depth_term_dropped",
        "Depth term left out",
        "0; right: weight 1",
        BOTH,
        edit(SOURCE, "if weights.depth > 0 and depth is not None:", "if False and depth is not None:"),
    ),
    port(
        "laplacian_term_dropped",
        "Laplacian term left out",
        "0; right: lambda_lap",
        BOTH,
        edit(SOURCE, "if weights.laplacian > 0 and", "if False and"),
    ),
    port(
        "penalty_dropped",
        "Matern penalty left out",
        "0; right: lambda_msp",
        "objective",
        edit(VIEW, "config.loss.lambda_msp * penalty", "0 * penalty"),
        edit(
            VIEW,
            "matern_penalty_reverse(config.loss.lambda_msp, penalty_saved)",
            "matern_penalty_reverse(0.0, penalty_saved)",
        ),
    ),
    port(
        "ssim_term_dropped",
        "L1 alone",
        "w = 0; right: (1 - w) L1 + w (1 - SSIM)",
        BOTH,
        edit(SOURCE, "l1, l1_saved = masked_l1", "ssim_weight = 0.0\n    l1, l1_saved = masked_l1"),
    ),
    port(
        "ssim_sign",
        "SSIM with the wrong sign",
        "w SSIM; right: w (1 - SSIM)",
        BOTH,
        edit(SOURCE, "ssim_weight * (1.0 - ssim)", "ssim_weight * ssim"),
        edit(SOURCE, "masked_ssim_reverse(-ssim_weight, ssim_saved)", "masked_ssim_reverse(ssim_weight, ssim_saved)"),
    ),
    port(
        "l1_not_reduced",
        "L1 with weight 1 beside SSIM",
        "L1 + w (1 - SSIM); right: (1 - w) L1 + w (1 - SSIM)",
        BOTH,
        edit(SOURCE, "loss, terms = (1.0 - ssim_weight) * l1", "loss, terms = l1"),
        edit(SOURCE, "masked_l1_reverse(1.0 - ssim_weight, l1_saved)", "masked_l1_reverse(1.0, l1_saved)"),
    ),
    port(
        "smoothness_dropped",
        "Smoothness left out",
        "0; right: its weight",
        BOTH,
        edit(SOURCE, "if weights.smoothness > 0:", "if False:"),
    ),
    port(
        "photometric_of_clamped_render",
        "Loss of the clamped render",
        "clip(render); right: as it is",
        "objective",
        edit(
            SOURCE,
            "    l1, l1_saved = masked_l1_forward(colour,",
            "    inside, colour = (colour >= 0) & (colour <= 1), np.clip(colour, 0, 1)\n"
            "    l1, l1_saved = masked_l1_forward(colour,",
        ),
        edit(
            SOURCE,
            "    return ImageLoss(loss, terms, d_colour, np.zeros",
            "    d_colour = np.where(inside, d_colour, 0)\n    return ImageLoss(loss, terms, d_colour, np.zeros",
        ),
    ),
    port(
        "laplacian_gradient_dropped",
        "Laplacian loss without gradient",
        "value only; right: its adjoint too",
        BOTH,
        edit(SOURCE, "Term(value, laplacian_loss_reverse(weight, saved), None)", "Term(value, None, None)"),
    ),
    port(
        "depth_loss_gradient_dropped",
        "Depth loss without gradient",
        "value only; right: by the depth image",
        BOTH,
        edit(SOURCE, "Term(value, None, normalised_depth_reverse(weight, saved))", "Term(value, None, None)"),
    ),
    port(
        "penalty_gradient_dropped",
        "Matern penalty without gradient",
        "value only; right: added to that of C",
        "objective",
        edit(
            VIEW,
            "matern_penalty_reverse(config.loss.lambda_msp, penalty_saved)",
            "matern_penalty_reverse(0.0, penalty_saved)",
        ),
    ),
    port(
        "motion_gradient_dropped",
        "Motion coefficients without the gradient of the position",
        "that of the penalty alone; right: and that of the position",
        "objective",
        edit(
            "fitting.model",
            'by_field["motion_coefficients"] = motion.d_motion_coefficients',
            'by_field["motion_coefficients"] = 0 * motion.d_motion_coefficients',
        ),
    ),
    port(
        "deformation_of_position_only",
        "No gradient to rotation and scale offsets",
        "0; right: all ten channels",
        "objective",
        edit(
            "fitting.model",
            "[grads.d_position, grads.d_quaternion, grads.d_log_scale]",
            "[grads.d_position, 0 * grads.d_quaternion, 0 * grads.d_log_scale]",
        ),
    ),
    port(
        "residual_gradient_unscaled",
        "1 / Y00 missing in the gradient of the residual",
        "Y00 times too small",
        "objective",
        edit(
            "fitting.model",
            'by_field["appearance_coefficients"] = appearance.d_appearance_coefficients',
            'by_field["appearance_coefficients"] = 0.28209479177387814 * appearance.d_appearance_coefficients',
        ),
    ),
    port(
        "sums_in_any_order",
        "Sums in an order that changes",
        "other bits each time; right: the same bits",
        "determinism",
        edit(
            SCENE,
            "(OBJECTIVE.compute(inputs, settings) for _ in range(2))",
            '(OBJECTIVE.compute(inputs, dict(settings) | {"_compositor": way}) for way in ("definition", "blocks"))',
        ),
    ),
]
