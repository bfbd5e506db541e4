"""Wrong ports of the whole method: composition of the scene, terms of the objective, training."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.deformation import deformation_forward
from endotsr.equations.dictionary import normalised_atoms
from endotsr.equations.motion import motion_forward
from endotsr.golden.negative import Negative, Request, Wrong, setting, swapped
from endotsr.kernels.constants import Y00
from endotsr.stages.requests import gaussians_of, model_of, spectral_of


def _loss(**changes: Any) -> dict[str, Wrong]:
    return {"objective": setting(**{f"loss__{key}": value for key, value in changes.items()})}


def _config(**changes: Any) -> dict[str, Wrong]:
    """In training, and in the schedules alone."""
    wrong = setting(**{f"config__{key}": value for key, value in changes.items()})
    return {"training": wrong, "schedule": wrong}


def _offsets(request: Request) -> NDArray:
    g, model = gaussians_of(request.inputs), model_of(request.settings)
    assert g.fdm_weight is not None and g.fdm_centre is not None and g.fdm_width is not None
    return deformation_forward(g.fdm_weight, g.fdm_centre, g.fdm_width, request.settings["t"], model.basis)[0]


def _normalised_motion(request: Request) -> dict[str, NDArray]:
    spectral, t = spectral_of(request.inputs, request.settings), request.settings["t"]
    c = request.inputs["motion_coefficients"]
    phi_bar = normalised_atoms(t, spectral.omega, spectral.statistics).astype(c.dtype)
    moved = motion_forward(c, phi_bar)[0]
    return {"position_at_t": request.inputs["position"] + _offsets(request)[:3] + moved}


def _shifted_channels(request: Request) -> dict[str, NDArray]:
    """Quaternion last: 3-5 log-scale, 6-9 quaternion."""
    offsets = _offsets(request)
    return {
        "log_scale_at_t": request.inputs["log_scale"] + offsets[3:6],
        "quaternion_at_t": request.inputs["quaternion"] + offsets[6:10],
    }


def _after_activation(request: Request) -> dict[str, NDArray]:
    scale = np.exp(request.inputs["log_scale"]) + _offsets(request)[7:10]
    return {"log_scale_at_t": np.log(np.maximum(scale, 1e-6))}


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


def _gradients_without(**changes: Any) -> Wrong:
    """Right values, but gradients as if a term had no weight."""
    wrong = setting(**{f"loss__{key}": value for key, value in changes.items()})

    def limited(request: Request) -> dict[str, NDArray] | None:
        found = wrong(request)
        return None if found is None else {name: a for name, a in found.items() if name.startswith("d_")}

    return limited


def _position_offsets_only(request: Request) -> dict[str, NDArray]:
    """Rotation and scale offsets of the deformation learn nothing."""
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


NEGATIVES = [
    Negative("motion_of_normalised_atoms", "Motion from normalised atoms", "phi_bar; right: raw phi",
             {"scene": _normalised_motion}),
    Negative("deformation_channels_shifted", "Deformation channels in another order",
             "position, log-scale, quaternion; right: position, quaternion, log-scale", {"scene": _shifted_channels}),
    Negative("scale_offset_after_activation", "Offset added to the semi-axis", "exp(s) + psi; right: in the exponent",
             {"scene": _after_activation}),
    Negative("depth_term_dropped", "Depth term left out", "0; right: weight 1", _loss(depth_weight=0.0)),
    Negative("laplacian_term_dropped", "Laplacian term left out", "0; right: lambda_lap", _loss(lambda_lap=0.0)),
    Negative("penalty_dropped", "Matern penalty left out", "0; right: lambda_msp", _loss(lambda_msp=0.0)),
    Negative("ssim_term_dropped", "L1 alone", "w = 0; right: (1 - w) L1 + w (1 - SSIM)", _loss(ssim_weight=0.0)),
    Negative("ssim_sign", "SSIM with the wrong sign", "w SSIM; right: w (1 - SSIM)", {"objective": _ssim_sign}),
    Negative("smoothness_dropped", "Smoothness left out", "0; right: its weight", _loss(smoothness_weight=0.0)),
    Negative("photometric_of_clamped_render", "Loss of the clamped render", "clip(render); right: as it is",
             {"objective": _clamped_render}),
    Negative("laplacian_gradient_dropped", "Laplacian loss without gradient", "value only; right: its adjoint too",
             {"objective": _gradients_without(lambda_lap=0.0)}),
    Negative("depth_loss_gradient_dropped", "Depth loss without gradient", "value only; right: by the depth image",
             {"objective": _gradients_without(depth_weight=0.0)}),
    Negative("penalty_gradient_dropped", "Matern penalty without gradient", "value only; right: added to that of C",
             {"objective": _gradients_without(lambda_msp=0.0)}),
    Negative("deformation_of_position_only", "No gradient to rotation and scale offsets", "0; right: all ten channels",
             {"objective": _position_offsets_only}),
    Negative("residual_gradient_unscaled", "1 / Y00 missing in the gradient of the residual", "Y00 times too small",
             {"objective": _unscaled_residual}),
    Negative("skipped_step_when_densifying", "No optimiser step when densifying", "skipped; right: taken",
             _config(optimiser__legacy_skip=True)),
    Negative("residuals_activated_late", "Residuals start one iteration late", "K_s + 2; right: K_s + 1",
             _config(training__residual_activation=lambda k: k + 1)),
    Negative("rates_not_decaying", "Learning rates do not decay", "constant; right: exponential to 1/100",
             _config(optimiser__final_factor=1.0)),
    Negative("laplacian_weight_not_ramped", "Detail weight full from the start", "1; right: 0, then linear",
             _config(loss__laplacian_from=0, loss__laplacian_full=0)),
    Negative("penalty_dropped_in_training", "Matern penalty left out of training", "0; right: lambda_msp",
             _config(loss__lambda_msp=0.0)),
    Negative("calibration_of_half_ratio", "Calibration with another ratio", "r / 2; right: r",
             _config(loss__gradient_ratio=lambda r: r / 2)),
    Negative("densify_threshold_in_pixels", "Screen gradient in pixels", "per px; right: times half the image size",
             _config(density__gradient_threshold=lambda v: v * 12.0) | {"density": setting(width=2, height=2)}),
    Negative("statistics_over_test_frames_in_training", "Training statistics over test frames too",
             "all stamps; right: training stamps", {"objective": swapped(
                 lambda i: {"train_index": np.arange(i["times"].size)})}),
    Negative("sums_in_any_order", "Sums in an order that changes", "other bits each time; right: the same bits",
             {"determinism": _other_bits}),
]  # fmt: skip
