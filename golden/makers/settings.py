"""The settings of a case as stored: those that the functions of the method read, and what differs from its default.

A port reads these keys by name. A setting that is added outside of the method changes no case, and one of the method
is listed here when a case is made for it. A key that ports read stays listed, also where the configuration has lost
it.
"""

from typing import Any

import msgspec

from endotsr.config import Config

READ: dict[str, tuple[str, ...]] = {
    "model": (
        "appearance", "spectral_motion", "laplacian", "deformation", "exposure", "pose_correction", "basis", "bases",
        "initial_width", "harmonics_degree", "frequencies", "frequency_min", "frequency_max", "beta",
        "correlation_length",
    ),
    "raster": ("preset", "near", "alpha_cutoff", "transmittance_stop", "alpha_max"),
    "loss": (
        "ssim_weight", "depth_weight", "smoothness_weight", "total_variation_factor", "smoothness_from", "lambda_msp",
        "lambda_lap", "laplacian_from", "laplacian_full", "upsampling", "gradient_ratio", "calibration_views",
    ),
    "optimiser": (
        "position", "deformation", "deformation_position_factor", "harmonics_base", "harmonics_rest", "opacity",
        "scale", "rotation", "exposure", "pose", "spectral_motion_factor", "appearance_factor", "final_factor",
        "annealed_factor", "annealing_from", "restart_residual_schedule", "beta1", "beta2", "epsilon", "legacy_skip",
    ),
    "density": (
        "start", "interval", "until", "growth", "gradient_threshold", "extent", "dense_fraction", "prune_opacity",
        "maximum",
    ),
    "training": ("iterations", "residual_activation", "harmonics_interval"),
}  # fmt: skip
"""Section -> its keys, stored at any value. The initialisation is read by its own operation alone."""
OF_THE_INITIALISATION = ("motion_threshold",)


def written(config: Config) -> dict[str, Any]:
    """The configuration of a case of `schedule` or `training`."""
    sections = {name: section_of(getattr(config, name), READ.get(name, ())) for name in config.__struct_fields__[1:]}
    return {"preset": config.preset} | {name: values for name, values in sections.items() if values}


def written_section(section: msgspec.Struct, keys: tuple[str, ...] = ()) -> dict[str, Any]:
    """One section, for an operation that reads no other; by default with the keys that `READ` lists."""
    return section_of(section, keys or READ[type(section).__name__.removesuffix("Config").lower()])


def section_of(section: msgspec.Struct, keys: tuple[str, ...]) -> dict[str, Any]:
    """The keys of a section that are listed or differ from their default, in the order of the configuration."""
    values, defaults = msgspec.to_builtins(section), msgspec.to_builtins(type(section)())
    return {key: value for key, value in values.items() if key in keys or value != defaults[key]}
