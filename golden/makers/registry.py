"""The families of golden cases with their contents, and the outputs of every operation.

A family module defines OPERATIONS (the operations of its cases) and cases(). Its mistakes are in a TOML file of the
same name, see `makers.wrong.wrong_ports`. A mistake belongs to the family of the rule that it breaks; if it also
affects cases of later families, it lists their operations. `JUDGED` lists, in order, every output, further output and
gradient of an operation with its level, its unit, the scale of its comparison, and the independent program that
computes its value.
"""

import importlib
from types import ModuleType
from typing import NamedTuple

from endotsr.definition.exposure import EXPOSURES
from endotsr.port.stages.compositing import IMAGES
from endotsr.port.stages.laplacian import LEVELS
from endotsr.port.stages.optimiser import RESIDUAL_RATES, SQUARES, STATE, TERMS
from endotsr.port.stages.scene import TWICE
from endotsr.training.scene.gaussians import Gaussians
from makers.making import Spec
from makers.wrong import WrongPort, wrong_ports

FAMILIES = (
    "reading", "dictionary", "appearance", "motion", "matern", "laplacian", "calibration", "deformation", "adam",
    "masked_l1", "masked_ssim", "depth", "smoothness", "exposure", "pose", "registration", "covariance", "projection",
    "harmonics", "composite", "composite_limits", "render", "schedule", "density", "initialisation", "scene",
    "objective", "training", "other_settings", "extremes", "narrow", "wide", "switches",
    "borders", "exposed", "sides",
)  # fmt: skip


def families() -> list[ModuleType]:
    """The modules of the families, in the order of the method."""
    return [importlib.import_module(f"makers.{name}") for name in FAMILIES]


def all_specs() -> list[Spec]:
    """Every case, in the order of the families. Raises ValueError for duplicate names."""
    found = [spec for family in families() for spec in family.cases()]
    names = [spec.name for spec in found]
    if len(set(names)) != len(names):
        raise ValueError("a golden case is named twice")
    return found


def all_wrong_ports() -> dict[str, WrongPort]:
    """Every wrong port by its flag. Raises ValueError for duplicate flags."""
    found: dict[str, WrongPort] = {}
    for wrong_port in (port for family in FAMILIES for port in wrong_ports(family)):
        if wrong_port.flag in found:
            raise ValueError(f"wrong port {wrong_port.flag} is named twice")
        found[wrong_port.flag] = wrong_port
    return found


# ---- what a port answers ----


class Judged(NamedTuple):
    """An array that a port returns."""

    level: int
    unit: str = "1"
    scale: str = "max"  # "exact", "max", "last" or "identical OUTPUT"
    oracle: str = ""  # name in the golden files of the independent program that gives the value; empty: there is none
    least32: float = 0.0  # least float32 tolerance: what another sound formula loses, beyond the measured spread
    order: str = ""  # "iteration": entry k is of iteration k + 1


EXACT = "exact"
TEXTBOOK = 2e-4  # E[x^2] - E[x]^2 in float32 over C2 = 9e-4: the usual form of SSIM loses this much
PER_DISPLAY, PER_LENGTH = "loss per display unit", "loss per scene unit"
MASKS, PROJECTED, DENSITY = "laplacian.support_masks", "projection.projection_forward", "density_control.densify"
DRAWN, REVERSED = "render.render_forward", "compositing.composite_reverse"
UNITS = dict(zip(IMAGES, ("display", "scene unit", "1")))
GRADIENT_UNITS = {"position": "loss per scene unit", "motion_coefficients": "loss per scene unit"}
RATES = [
    "position", "quaternion", "log_scale", "opacity_logit", "harmonics_base", "harmonics_rest", "fdm_weight_position",
    "fdm_weight_other", "fdm_centre", "fdm_width", *RESIDUAL_RATES,
]  # fmt: skip

JUDGED: dict[str, dict[str, Judged]] = {
    "reading": {
        **{name: Judged(0, scale="exact") for name in ("column", "flat", "scalar", "empty")},
        **{name: Judged(0, scale="exact") for name in ("tissue_pixels", "tissue_row")},
        **{name: Judged(0, "px", "exact") for name in ("sample_x", "sample_y")},
    },
    "generator": {name: Judged(0, scale="exact") for name in ("words", "unit_numbers")},
    "frequencies": {"omega": Judged(1, "cycles per sequence", oracle="fourier_oracle.frequencies")},
    "dictionary": {
        "phi": Judged(1, oracle="fourier_oracle.dictionary"),
        "d_t": Judged(2, "loss"),
        "d_omega": Judged(2, "loss per cycle"),
    },
    "atoms": {
        "mean": Judged(1),
        "rms": Judged(1),
        "dead": Judged(1, scale="exact"),
        "phi_bar": Judged(1, oracle="fourier_oracle.normalised"),
        "d_phi": Judged(2, "loss"),
    },
    "appearance": {
        "residual": Judged(1, "display / Y00", oracle="appearance.appearance_forward"),
        "d_appearance_coefficients": Judged(2, "loss", "last", "appearance.appearance_reverse"),
        "d_phi_bar": Judged(2, "loss", oracle="appearance.appearance_reverse"),
    },
    "motion": {
        "translation": Judged(1, "scene unit", oracle="motion.motion_forward"),
        "d_motion_coefficients": Judged(2, "loss per scene unit", "last", "motion.motion_reverse"),
        "d_phi": Judged(2, "loss", oracle="motion.motion_reverse"),
    },
    "matern": {
        "rho": Judged(1, oracle="matern_oracle.weights"),
        "penalty": Judged(1, "scene unit^2", oracle="matern.matern_penalty_forward"),
        "d_motion_coefficients": Judged(2, "loss per scene unit", oracle="matern.matern_penalty_reverse"),
    },
    "laplacian": {
        **{f"band_{j}": Judged(1, "display", oracle="laplacian.laplacian_levels") for j in range(1, LEVELS + 1)},
        **{f"valid_{j}": Judged(1, scale="exact", oracle=MASKS) for j in range(1, LEVELS + 1)},
        "loss": Judged(1, "display", oracle="laplacian.laplacian_loss_forward"),
        "d_rendered": Judged(2, PER_DISPLAY, oracle="laplacian.laplacian_loss_reverse"),
    },
    "calibration": {
        "g_rgb": Judged(1, PER_DISPLAY),
        "g_lap": Judged(1, PER_DISPLAY),
        "lambda_lap": Judged(1, oracle="calibration.calibrate"),
        "refused": Judged(1, scale="exact"),
    },
    "deformation": {
        "offsets": Judged(1, "raw parameter", "last", "deformation.deformation_forward"),
        "d_fdm_weight": Judged(2, "loss per raw parameter", "last", "deformation.deformation_reverse"),
        "d_fdm_centre": Judged(2, "loss", "last", "deformation.deformation_reverse"),
        "d_fdm_width": Judged(2, "loss", "last", "deformation.deformation_reverse"),
        "d_t": Judged(2, "loss", oracle="deformation.deformation_reverse"),
    },
    "covariance": {
        "rotation": Judged(1, "1", "last", "covariance.rotation_of"),
        "scale": Judged(1, "scene unit", "last"),
        "d_quaternion": Judged(2, "loss", "last"),
        "d_log_scale": Judged(2, "loss", "last"),
    },
    "projection": {
        "visible": Judged(1, scale="exact"),
        "mean2d": Judged(1, "px", "last", PROJECTED),
        "covariance2d": Judged(1, "px^2", "last", PROJECTED),
        "depth": Judged(1, "scene unit", "last", PROJECTED),
        "d_position": Judged(2, "loss per scene unit", "last"),
        "d_rotation": Judged(2, "loss", "last"),
        "d_scale": Judged(2, "loss per scene unit", "last"),
        "d_rotation_matrix": Judged(2, "loss"),
        "d_translation": Judged(2, "loss per scene unit"),
    },
    "harmonics": {
        "colour": Judged(1, "display", oracle="harmonics.harmonics_forward"),
        "d_harmonics": Judged(2, "loss"),
        "d_residual": Judged(2, "loss"),
        "d_position": Judged(2, "loss per scene unit"),
        "d_centre": Judged(2, "loss per scene unit"),
    },
    "composite": {
        **{name: Judged(1, unit, oracle="compositing.composite_forward") for name, unit in UNITS.items()},
        "d_mean2d": Judged(2, "loss per px", "last", REVERSED),
        "d_covariance2d": Judged(2, "loss per px^2", "last", REVERSED),
        "d_opacity_logit": Judged(2, "loss", "last", REVERSED),
        "d_colour": Judged(2, "loss per display unit", "last", REVERSED),
        "d_depth": Judged(2, "loss per scene unit", "last", REVERSED),
        "d_background": Judged(2, "loss per display unit", oracle=REVERSED),
    },
    "render": {
        **{name: Judged(3, unit, oracle=DRAWN) for name, unit in UNITS.items()},
        "visible": Judged(3, scale="exact"),
        "d_position": Judged(3, "loss per scene unit", "last"),
        "d_quaternion": Judged(3, "loss", "last"),
        "d_log_scale": Judged(3, "loss", "last"),
        "d_opacity_logit": Judged(3, "loss", "last"),
        "d_harmonics": Judged(3, "loss", "last"),
        "d_residual": Judged(3, "loss", "last"),
        "d_mean2d": Judged(3, "loss per px", "last"),
        "d_background": Judged(3, "loss per display unit"),
        "d_rotation_matrix": Judged(3, "loss"),
        "d_translation": Judged(3, "loss per scene unit"),
    },
    "masked_l1": {
        "loss": Judged(1, "display", oracle="masked_l1.masked_l1_forward"),
        "d_rendered": Judged(2, PER_DISPLAY),
    },
    "masked_ssim": {
        "ssim": Judged(1, oracle="masked_ssim.masked_ssim_forward", least32=TEXTBOOK),
        "d_rendered": Judged(2, PER_DISPLAY, oracle="masked_ssim.masked_ssim_reverse", least32=TEXTBOOK),
    },
    "normalised_depth": {
        "loss": Judged(1, oracle="depth.normalised_depth_forward"),
        "d_rendered_depth": Judged(2, PER_LENGTH, oracle="depth.normalised_depth_forward"),
    },
    "smoothness": {
        "loss": Judged(1, "scene unit^2", oracle="smoothness.smoothness_forward"),
        "d_rendered": Judged(2, PER_DISPLAY, oracle="smoothness.smoothness_forward"),
        "d_rendered_depth": Judged(2, PER_LENGTH, oracle="smoothness.smoothness_forward"),
    },
    "exposure": {
        "exposed": Judged(1, "display", oracle="exposure.exposure_forward"),
        "d_colour": Judged(2, "loss per display", oracle="exposure.exposure_reverse"),
        "d_log_gain": Judged(2, "loss", oracle="exposure.exposure_reverse"),
        "d_bias": Judged(2, "loss per display", oracle="exposure.exposure_reverse"),
    },
    "pose": {
        "corrected_rotation": Judged(1, oracle="pose_oracle.corrected"),
        "corrected_translation": Judged(1, "scene", oracle="pose_oracle.corrected"),
        "d_rotation": Judged(2, "loss", oracle="pose_oracle.gradients"),
        "d_translation": Judged(2, "loss per scene", oracle="pose_oracle.gradients"),
        "d_rotation_vector": Judged(2, "loss per rad", oracle="pose_oracle.gradients"),
        "d_offset": Judged(2, "loss per scene", oracle="pose_oracle.gradients"),
    },
    "registration": {
        "residual": Judged(1, "unit of the picture", oracle="registration.registration_forward"),
        "seen": Judged(1, scale="exact", oracle="registration.registration_forward"),
        "d_rotation": Judged(2, "loss", oracle="registration.registration_reverse"),
        "d_translation": Judged(2, "loss per scene unit", oracle="registration.registration_reverse"),
        "d_points": Judged(2, "loss per scene unit", oracle="registration.registration_reverse"),
        "d_reference": Judged(2, "loss per unit of the picture", oracle="registration.registration_reverse"),
    },
    "objective": {
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
        "d_exposure_bias": Judged(3, "loss per display unit"),
    },
    "scene": {
        "position_at_t": Judged(1, "scene unit", "last", "motion.motion_forward"),
        "quaternion_at_t": Judged(1, "1", "last", "deformation.deformation_forward"),
        "log_scale_at_t": Judged(1, "1", "last", "deformation.deformation_forward"),
        "residual_at_t": Judged(1, "display / Y00", "last", "appearance.appearance_forward"),
    },
    "determinism": {
        **{f"{name}_1": Judged(5, "loss") for name in TWICE},
        **{f"{name}_2": Judged(5, "loss", f"identical {name}_1") for name in TWICE},
    },
    "adam": {
        "parameter_after": Judged(1, oracle="adam.adam_scalar"),
        "first": Judged(1),
        "second": Judged(1),
    },
    "schedule": {
        **{f"rate_{name}": Judged(1, "per step", oracle="schedules.learning_rates") for name in RATES},
        "laplacian_weight": Judged(1, oracle="schedules.learning_rates"),
        **{
            name: Judged(1, scale=EXACT, oracle="schedules.learning_rates")
            for name in ("degree", "residuals", "smoothness", "gathers", "densifies")
        },
    },
    "density": {
        "extent": Judged(1, "scene unit", oracle=DENSITY),
        "mean_gradient": Judged(1, "loss per NDC unit", oracle=DENSITY),
        **{
            name: Judged(1, scale=EXACT, oracle=DENSITY)
            for name in ("pruned", "cloned", "split", "count", "parent", "moments_kept")
        },
        "position_after": Judged(1, "scene unit", oracle=DENSITY),
        "log_scale_after": Judged(1, oracle=DENSITY),
    },
    "initialisation": {
        "count": Judged(1, scale=EXACT, oracle="initialisation.initialise"),
        "position": Judged(1, "scene unit", "last", "initialisation.initialise"),
        "log_scale": Judged(1, oracle="initialisation.initialise"),
        "harmonics": Judged(1, "display / Y00", oracle="initialisation.initialise"),
        **{name: Judged(1) for name in ("quaternion", "opacity_logit", "fdm_weight", "fdm_centre", "fdm_width")},
    },
    "training": {
        "lambda_lap": Judged(4),
        **{name: Judged(4, order="iteration") for name in TERMS},
        "loss": Judged(4, "loss", order="iteration"),
        "count": Judged(4, scale=EXACT, order="iteration"),
        **{name: Judged(4, "raw parameter^2", order="iteration") for name in SQUARES},
        **{name: Judged(4, order="iteration") for name in STATE},
        **{f"final_{name}": Judged(4, "raw parameter", "max") for name in Gaussians._fields},
        **{f"square_{name}": Judged(4, "raw parameter^2", order="iteration") for name in EXPOSURES},
        **{f"final_{name}": Judged(4, "raw parameter", "max") for name in EXPOSURES},
    },
}
