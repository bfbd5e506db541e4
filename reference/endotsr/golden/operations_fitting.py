"""Operations of training around the objective: schedules (6), (B10), density control (B11), initialisation (B12)."""

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import DensityConfig, InitialisationConfig
from endotsr.fitting.adam import adam_state
from endotsr.fitting.schedules import (
    active_degree,
    densify_now,
    laplacian_ramp,
    learning_rates,
    residuals_active,
    smoothness_active,
    statistics_active,
)
from endotsr.golden.operation import Asked, Inputs, Operation, Settings, real_of
from endotsr.golden.operations_scene import Tape, config_of, model_of, sequence_of
from endotsr.scene.density_control import densify, empty_statistics, gather_statistics, scene_extent
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.scene.initialisation import initialise
from endotsr.splatting.camera import Camera

Found = dict[str, NDArray | float | None]

RESIDUAL_RATES = ("appearance_coefficients", "motion_coefficients")
CONSTANT_LENS = {"fx": 1.0, "fy": 1.0, "cx": 0.0, "cy": 0.0, "width": 1, "height": 1}  # the extent asks for poses only


def _rates(iteration: int, config) -> dict[str, float]:
    """Rates by group; those of the residuals are 0 while there are none."""
    rates: dict[str, Any] = dict.fromkeys(RESIDUAL_RATES, 0.0) | learning_rates(iteration, config)
    for name, parts in (("harmonics", ("base", "rest")), ("fdm_weight", ("position", "other"))):
        for part, (_, rate) in zip(parts, rates.pop(name)):
            rates[f"{name}_{part}"] = rate
    return rates


def _schedule(inputs: Inputs, settings: Settings) -> Found:
    config, iterations = config_of(settings, np.dtype(np.float64)), [int(i) for i in inputs["iteration"]]
    rows = [_rates(i, config) for i in iterations]
    found: Found = {f"rate_{name}": np.array([row[name] for row in rows]) for name in rows[0]}
    assert isinstance(config.loss.lambda_lap, float)
    return found | {
        "laplacian_weight": np.array([config.loss.lambda_lap * laplacian_ramp(i, config) for i in iterations]),
        "degree": np.array([active_degree(i, config) for i in iterations], np.int64),
        "residuals": np.array([residuals_active(i, config) for i in iterations]),
        "smoothness": np.array([smoothness_active(i, config) for i in iterations]),
        "gathers": np.array([statistics_active(i, config) for i in iterations]),
        "densifies": np.array([densify_now(i, config) for i in iterations]),
    }


def _density(inputs: Inputs, settings: Settings) -> Found:
    """Statistics of some views, then one densification. Indices travel in the harmonics, ones in the first moments."""
    config, count = msgspec.convert(settings["density"], DensityConfig), inputs["opacity_logit"].size
    names = ("position", "quaternion", "log_scale", "opacity_logit")
    index = np.arange(float(count))[None, None]
    gaussians = Gaussians(*(inputs[name] for name in names), harmonics=np.repeat(index, 3, axis=1))
    statistics = empty_statistics(count)
    for d_mean, visible in zip(inputs["d_mean2d"], inputs["visible"]):
        gather_statistics(statistics, d_mean, visible, settings["width"], settings["height"])
    poses = zip(inputs["rotation_matrices"], inputs["translations"])
    extent = scene_extent(config, [Camera(*pose, **CONSTANT_LENS) for pose in poses])  # type: ignore[arg-type]
    moments = adam_state(arrays(gaussians))
    moments.first["opacity_logit"][:] = 1.0
    tape: Any = Tape(np.zeros(0), inputs["split_noise"])
    made = densify(gaussians, moments, statistics, config, tape, extent)
    parent = made.gaussians.harmonics[0, 0].astype(np.int64)
    rows, survivors = np.arange(count), parent.size - made.cloned - 2 * made.split
    cloned, split = np.split(parent[survivors : survivors + made.cloned + made.split], [made.cloned])
    return {
        "extent": extent,
        "mean_gradient": statistics.gradient_sum / np.maximum(statistics.visits, 1),
        "pruned": ~np.isin(rows, parent),
        "cloned": np.isin(rows, cloned),
        "split": np.isin(rows, split),
        "count": np.array(parent.size),
        "parent": parent,
        "moments_kept": made.adam.first["opacity_logit"] == 1.0,
        "position_after": made.gaussians.position,
        "log_scale_after": made.gaussians.log_scale,
    }


def _initialisation(inputs: Inputs, settings: Settings) -> Found:
    """Every candidate is taken, so that no random number is drawn."""
    config = msgspec.convert(settings["initialisation"], InitialisationConfig)
    sequence, no_draw = sequence_of(inputs, settings["camera"]), None
    found = initialise(sequence, config, model_of(settings), no_draw, real_of(inputs))  # type: ignore[arg-type]
    return {"count": np.array(found.count), **arrays(found)}


EXACT = "exact"
RATES = [
    "position", "quaternion", "log_scale", "opacity_logit", "harmonics_base", "harmonics_rest", "fdm_weight_position",
    "fdm_weight_other", "fdm_centre", "fdm_width", *RESIDUAL_RATES,
]  # fmt: skip

OPERATIONS = [
    Operation("schedule", "B10", "rates, weights and switches of some iterations", _schedule, {
        **{f"rate_{name}": Asked(1, "per step", oracle="fitting_oracle.schedule") for name in RATES},
        "laplacian_weight": Asked(1, oracle="fitting_oracle.schedule"),
        **{name: Asked(1, scale=EXACT, oracle="fitting_oracle.schedule")
           for name in ("degree", "residuals", "smoothness", "gathers", "densifies")},
    }),
    Operation("density", "B11", "statistics of some views, one densification", _density, {
        "extent": Asked(1, "scene unit", oracle="fitting_oracle.density"),
        "mean_gradient": Asked(1, "loss per NDC unit", oracle="fitting_oracle.density"),
        **{name: Asked(1, scale=EXACT, oracle="fitting_oracle.density")
           for name in ("pruned", "cloned", "split", "count", "parent", "moments_kept")},
        "position_after": Asked(1, "scene unit", oracle="fitting_oracle.density"),
        "log_scale_after": Asked(1, oracle="fitting_oracle.density"),
    }),
    Operation("initialisation", "B12", "Gaussians from depth maps", _initialisation, {
        "count": Asked(1, scale=EXACT, oracle="fitting_oracle.initialisation"),
        "position": Asked(1, "scene unit", "last", "fitting_oracle.initialisation"),
        "log_scale": Asked(1, oracle="fitting_oracle.initialisation"),
        "harmonics": Asked(1, "display / Y00", oracle="fitting_oracle.initialisation"),
        **{name: Asked(1) for name in ("quaternion", "opacity_logit", "fdm_weight", "fdm_centre", "fdm_width")},
    }),
]  # fmt: skip
