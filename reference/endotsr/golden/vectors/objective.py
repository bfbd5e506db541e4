"""Families `objective` and `determinism`: the loss of one view (6) with every term and every gradient.

A moving scene, an observed image with mask, prior depth and edges, and the weights of the terms come in. The cases are
the presets, the other up-sampling rule, a pyramid level without valid pixels, and a rigid scene without components.
`determinism` requests the same objective twice: the bits must be equal.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.images import tissue
from endotsr.golden.vectors.making import Made, Seeds, Spec, changed, given
from endotsr.golden.vectors.moving import LENS, TIME, model_settings, moving_inputs
from endotsr.golden.vectors.views import PRESETS
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort, swapped, within
from endotsr.kernels.constants import Y00
from endotsr.stages.requests import raster_dict

OPERATIONS = ("objective", "determinism")
HEIGHT, WIDTH = int(LENS["height"]), int(LENS["width"])
WEIGHTS = {
    "ssim_weight": 0.25, "depth_weight": 1.0, "smoothness_weight": 0.05, "total_variation_factor": 2.0,
    "lambda_msp": 1.0, "lambda_lap": 0.75, "upsampling": "co_sited",
}  # fmt: skip


def _image_inputs(seeds: Seeds) -> dict[str, Made]:
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
    inputs = moving_inputs(seeds, degree, static) | _image_inputs(seeds)
    if change:
        change(inputs)
    settings = {
        "t": TIME,
        "degree": degree,
        "camera": LENS,
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
             "deformation_of_position_only", "residual_gradient_unscaled", "statistics_over_test_frames_in_training",
             "pixel_corner_camera")  # fmt: skip
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


def _without(**changes: float) -> dict[str, Wrong]:
    """A weight of the loss set to 0, in values and gradients."""
    return within("loss", ("objective",), **changes)


def _ssim_sign(request: Request) -> dict[str, NDArray]:
    """w SSIM in place of w (1 - SSIM)."""
    w, ssim = request.settings["loss"]["ssim_weight"], request.right["term_ssim"]
    return {"objective": request.right["objective"] - w * (1 - ssim) + w * ssim}


def _clamped_render(request: Request) -> dict[str, NDArray] | None:
    """Loss of the render cut to [0, 1]."""
    colour, mask = request.right["colour_image"], request.inputs["mask"]
    if colour.max() <= 1:
        return None
    w, old = request.settings["loss"]["ssim_weight"], request.right["term_l1"]
    new = np.abs(np.clip(colour, 0, 1) - request.inputs["observed"])[:, mask].mean()
    return {"term_l1": new, "objective": request.right["objective"] + (1 - w) * (new - old)}


def _gradients_without(**changes: float) -> dict[str, Wrong]:
    """Right values, but gradients as if a term had no weight."""
    wrong = _without(**changes)["objective"]

    def limited(request: Request) -> Mapping[str, Any] | None:
        found = wrong(request)
        return None if found is None else {name: a for name, a in found.items() if name.startswith("d_")}

    return {"objective": limited}


def _position_offsets_only(request: Request) -> dict[str, NDArray]:
    """Rotation and scale offsets of the deformation receive no gradient."""
    out = {}
    for name in ("d_fdm_weight", "d_fdm_centre", "d_fdm_width"):
        if name in request.right:
            out[name] = request.right[name].copy()
            out[name][3:] = 0
    return out


def _unscaled_residual(request: Request) -> dict[str, NDArray]:
    name = "d_appearance_coefficients"
    return {name: request.right[name] * Y00} if name in request.right else {}


def _other_bits(request: Request) -> dict[str, NDArray]:
    """The second answer differs in the last bit of float32."""
    d = request.right["d_position_2"]
    return {"d_position_2": d * (1 + 1.2e-7)}


WRONG_PORTS = [
    WrongPort("depth_term_dropped", "Depth term left out", "0; right: weight 1", _without(depth_weight=0.0)),
    WrongPort("laplacian_term_dropped", "Laplacian term left out", "0; right: lambda_lap", _without(lambda_lap=0.0)),
    WrongPort("penalty_dropped", "Matern penalty left out", "0; right: lambda_msp", _without(lambda_msp=0.0)),
    WrongPort("ssim_term_dropped", "L1 alone", "w = 0; right: (1 - w) L1 + w (1 - SSIM)", _without(ssim_weight=0.0)),
    WrongPort("ssim_sign", "SSIM with the wrong sign", "w SSIM; right: w (1 - SSIM)", {"objective": _ssim_sign}),
    WrongPort("smoothness_dropped", "Smoothness left out", "0; right: its weight", _without(smoothness_weight=0.0)),
    WrongPort("photometric_of_clamped_render", "Loss of the clamped render", "clip(render); right: as it is",
              {"objective": _clamped_render}),
    WrongPort("laplacian_gradient_dropped", "Laplacian loss without gradient", "value only; right: its adjoint too",
              _gradients_without(lambda_lap=0.0)),
    WrongPort("depth_loss_gradient_dropped", "Depth loss without gradient", "value only; right: by the depth image",
              _gradients_without(depth_weight=0.0)),
    WrongPort("penalty_gradient_dropped", "Matern penalty without gradient", "value only; right: added to that of C",
              _gradients_without(lambda_msp=0.0)),
    WrongPort("deformation_of_position_only", "No gradient to rotation and scale offsets", "0; right: all ten channels",
              {"objective": _position_offsets_only}),
    WrongPort("residual_gradient_unscaled", "1 / Y00 missing in the gradient of the residual", "Y00 times too small",
              {"objective": _unscaled_residual}),
    WrongPort("statistics_over_test_frames_in_training", "Training statistics over test frames too",
              "all stamps; right: training stamps", {"objective": swapped(
                  lambda i: {"train_index": np.arange(i["times"].size)})}),
    WrongPort("sums_in_any_order", "Sums in an order that changes", "other bits each time; right: the same bits",
              {"determinism": _other_bits}),
]  # fmt: skip
