"""Operations of reading and of the paper's equations (1) to (5), (7), (B1), (B10)."""

import numpy as np
from numpy.typing import NDArray

from endotsr.equations.appearance import appearance_forward, appearance_reverse
from endotsr.equations.calibration import calibrate, rms
from endotsr.equations.deformation import deformation_forward, deformation_reverse
from endotsr.equations.dictionary import (
    AtomStatistics,
    atom_statistics,
    dictionary_forward,
    dictionary_reverse,
    frequencies,
    normalise_forward,
    normalise_reverse,
)
from endotsr.equations.laplacian import (
    laplacian_levels,
    laplacian_loss_forward,
    laplacian_loss_reverse,
    support_masks,
)
from endotsr.equations.matern import matern_penalty_forward, matern_penalty_reverse, matern_weights
from endotsr.equations.motion import motion_forward, motion_reverse
from endotsr.errors import CalibrationError
from endotsr.fitting.adam import AdamState, adam_update
from endotsr.golden.judge.words import fnv1a, words
from endotsr.golden.operation import Asked, Inputs, Operation, Settings


def _reading(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    array, mask = inputs["harmonics"], inputs["mask"]
    return {
        "column": np.array(array[..., settings["gaussian"]]),
        "flat": array.reshape(-1),
        "scalar": np.array(inputs["scalar"]),
        "empty": np.array(inputs["empty"]),
        "tissue_pixels": np.array(int(mask.sum()), np.int64),
        "tissue_row": np.flatnonzero(mask[settings["row"]]).astype(np.int64),
        "sample_x": (np.arange(mask.shape[1]) + 0.5).astype(array.dtype),
        "sample_y": (np.arange(mask.shape[0]) + 0.5).astype(array.dtype),
    }


def _generator(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    del inputs
    found = words(fnv1a(settings["seed"]), settings["count"])
    return {"words": found, "unit_numbers": (found >> np.uint64(40)).astype(np.float64) / 2.0**24}


def _frequencies(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    return {"omega": frequencies(settings["count"], settings["low"], settings["high"])}


def _dictionary(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    phi, saved = dictionary_forward(float(inputs["t"]), inputs["omega"])
    grads = dictionary_reverse(inputs["d_phi"], saved)
    return {"phi": phi, "d_t": np.array(grads.t), "d_omega": grads.omega}


def statistics_of(inputs: Inputs) -> AtomStatistics:
    """Statistics over the training stamps of a request."""
    return atom_statistics(inputs["times"][inputs["train_index"]], inputs["omega"].astype(np.float64))


def _atoms(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    statistics = statistics_of(inputs)
    phi_bar, saved = normalise_forward(inputs["phi"], statistics)
    return {
        "mean": statistics.mean,
        "rms": np.where(statistics.dead, 0.0, statistics.rms),
        "dead": statistics.dead,
        "phi_bar": phi_bar,
        "d_phi": normalise_reverse(inputs["d_phi_bar"], saved),
    }


def _appearance(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    residual, saved = appearance_forward(inputs["appearance_coefficients"], inputs["phi_bar"], settings["beta"])
    grads = appearance_reverse(inputs["d_residual"], saved)
    assert grads.phi_bar is not None
    return {
        "residual": residual,
        "d_appearance_coefficients": grads.appearance_coefficients,
        "d_phi_bar": grads.phi_bar,
    }


def _motion(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    translation, saved = motion_forward(inputs["motion_coefficients"], inputs["phi"])
    grads = motion_reverse(inputs["d_translation"], saved)
    assert grads.phi is not None
    return {"translation": translation, "d_motion_coefficients": grads.motion_coefficients, "d_phi": grads.phi}


def _matern(inputs: Inputs, settings: Settings) -> dict[str, NDArray | float]:
    rho = matern_weights(inputs["omega"].astype(np.float64), settings["correlation_length"])
    penalty, saved = matern_penalty_forward(inputs["motion_coefficients"], rho)
    d_coefficients = matern_penalty_reverse(float(inputs["d_penalty"]), saved)
    return {"rho": rho, "penalty": penalty, "d_motion_coefficients": d_coefficients}


def _laplacian(inputs: Inputs, settings: Settings) -> dict[str, NDArray | float]:
    rule, levels = settings["upsampling"], settings["levels"]
    rendered, mask = inputs["rendered"], inputs["mask"]
    masks = support_masks(mask, levels, rule)
    pyramid = laplacian_levels(inputs["observed"], levels, rule)
    loss, saved = laplacian_loss_forward(rendered, inputs["observed"], masks, rule)
    out: dict[str, NDArray | float] = {
        "loss": loss,
        "d_rendered": laplacian_loss_reverse(float(inputs["d_loss"]), saved),
    }
    for level in range(levels):
        out[f"band_{level + 1}"] = pyramid.bands[level]
        out[f"valid_{level + 1}"] = masks.bands[level]
    return out


def _calibration(inputs: Inputs, settings: Settings) -> dict[str, NDArray | float]:
    """One row a view; the gradients come as images, so that the RMS is part of the case."""
    g_rgb = [rms(view) for view in inputs["d_photometric"]]
    g_lap = [rms(view) for view in inputs["d_laplacian"]]
    views = [(str(k), a, b) for k, (a, b) in enumerate(zip(g_rgb, g_lap))]
    try:
        weight, refused = calibrate(views, settings["gradient_ratio"]).lambda_lap, False
    except CalibrationError:
        weight, refused = 0.0, True
    return {
        "g_rgb": np.array(g_rgb),
        "g_lap": np.array(g_lap),
        "lambda_lap": weight,
        "refused": np.array(refused),
    }


def _deformation(inputs: Inputs, settings: Settings) -> dict[str, NDArray | float]:
    weight, centre, width = inputs["fdm_weight"], inputs["fdm_centre"], inputs["fdm_width"]
    offsets, saved = deformation_forward(weight, centre, width, float(inputs["t"]), settings["basis"])
    grads = deformation_reverse(inputs["d_offsets"], saved)
    return {
        "offsets": offsets,
        "d_fdm_weight": grads.weight,
        "d_fdm_centre": grads.centre,
        "d_fdm_width": grads.width,
        "d_t": grads.t,
    }


def _adam(inputs: Inputs, settings: Settings) -> dict[str, NDArray]:
    """Steps with the gradients of the leading axis, one after the other."""
    parameter = inputs["parameter"].copy()
    state = AdamState({"p": np.zeros_like(parameter)}, {"p": np.zeros_like(parameter)}, {"p": 0})
    numbers = (settings[name] for name in ("beta1", "beta2", "epsilon"))
    beta1, beta2, epsilon = numbers
    for gradient in inputs["gradients"]:
        adam_update(state, {"p": parameter}, {"p": np.ascontiguousarray(gradient)}, {"p": settings["rate"]},
                    beta1, beta2, epsilon)  # fmt: skip
    return {"parameter_after": parameter, "first": state.first["p"], "second": state.second["p"]}


OPERATIONS = [
    Operation("reading", "", "echo parts of the inputs", _reading, {
        "column": Asked(0, scale="exact"), "flat": Asked(0, scale="exact"), "scalar": Asked(0, scale="exact"),
        "empty": Asked(0, scale="exact"), "tissue_pixels": Asked(0, scale="exact"),
        "tissue_row": Asked(0, scale="exact"), "sample_x": Asked(0, "px", "exact"), "sample_y": Asked(0, "px", "exact"),
    }),
    Operation("generator", "", "words of the written-out generator", _generator, {
        "words": Asked(0, scale="exact"), "unit_numbers": Asked(0, scale="exact"),
    }),
    Operation("frequencies", "1", "log-spaced frequencies", _frequencies, {
        "omega": Asked(1, "cycles per sequence", oracle="fourier_oracle.frequencies"),
    }),
    Operation("dictionary", "1", "atoms at one time and the way back", _dictionary, {
        "phi": Asked(1, oracle="fourier_oracle.dictionary"), "d_t": Asked(2, "loss"),
        "d_omega": Asked(2, "loss per cycle"),
    }, lambda s: ("dictionary",)),
    Operation("atoms", "1b", "statistics over the training stamps and normalised atoms", _atoms, {
        "mean": Asked(1), "rms": Asked(1), "dead": Asked(1, scale="exact"),
        "phi_bar": Asked(1, oracle="fourier_oracle.normalised"), "d_phi": Asked(2, "loss"),
    }, lambda s: ("normalise",)),
    Operation("appearance", "2", "bounded colour residual", _appearance, {
        "residual": Asked(1, "display / Y00", oracle="residuals_oracle.colour_residual"),
        "d_appearance_coefficients": Asked(2, "loss", "last", "residuals_oracle.colour_gradients"),
        "d_phi_bar": Asked(2, "loss", oracle="residuals_oracle.colour_gradients"),
    }, lambda s: ("appearance",)),
    Operation("motion", "3", "translation residual", _motion, {
        "translation": Asked(1, "scene unit", oracle="residuals_oracle.linear"),
        "d_motion_coefficients": Asked(2, "loss per scene unit", "last", "residuals_oracle.linear_gradients"),
        "d_phi": Asked(2, "loss", oracle="residuals_oracle.linear_gradients"),
    }, lambda s: ("motion",)),
    Operation("matern", "4", "Matern weights and penalty", _matern, {
        "rho": Asked(1, oracle="matern_oracle.weights"),
        "penalty": Asked(1, "scene unit^2", oracle="matern_oracle.penalty"),
        "d_motion_coefficients": Asked(2, "loss per scene unit", oracle="matern_oracle.penalty_gradient"),
    }, lambda s: ("matern_penalty",)),
    Operation("laplacian", "5", "pyramid of the observed image, valid pixels, loss", _laplacian, {
        "band_1": Asked(1, "display", oracle="laplacian_oracle.pyramid"),
        "band_2": Asked(1, "display", oracle="laplacian_oracle.pyramid"),
        "band_3": Asked(1, "display", oracle="laplacian_oracle.pyramid"),
        "valid_1": Asked(1, scale="exact", oracle="laplacian_oracle.masks_by_impulse_response"),
        "valid_2": Asked(1, scale="exact", oracle="laplacian_oracle.masks_by_impulse_response"),
        "valid_3": Asked(1, scale="exact", oracle="laplacian_oracle.masks_by_impulse_response"),
        "loss": Asked(1, "display", oracle="laplacian_oracle.loss"),
        "d_rendered": Asked(2, "loss per display unit", oracle="laplacian_oracle.loss_gradient"),
    }, lambda s: (f"laplacian_loss_{s['upsampling']}",)),
    Operation("calibration", "7", "detail weight from gradient images", _calibration, {
        "g_rgb": Asked(1, "loss per display unit"), "g_lap": Asked(1, "loss per display unit"),
        "lambda_lap": Asked(1, oracle="calibration_oracle.view_median_weight"), "refused": Asked(1, scale="exact"),
    }),
    Operation("deformation", "B1", "offsets of the flexible deformation model", _deformation, {
        "offsets": Asked(1, "raw parameter", "last", "deformation.offsets"),
        "d_fdm_weight": Asked(2, "loss per raw parameter", "last", "deformation.derivative"),
        "d_fdm_centre": Asked(2, "loss", "last", "deformation.derivative"),
        "d_fdm_width": Asked(2, "loss", "last", "deformation.derivative"),
        "d_t": Asked(2, "loss", oracle="deformation.derivative_by_time"),
    }, lambda s: (f"deformation_{s['basis']}",)),
    Operation("adam", "B10", "optimiser steps with given gradients", _adam, {
        "parameter_after": Asked(1, oracle="adam.adam_scalar"), "first": Asked(1), "second": Asked(1),
    }),
]  # fmt: skip
