"""Operations without a gradient: schedules (6), Adam (B10), density control (B11), initialisation (B12), training."""

from collections.abc import Iterable
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config, DensityConfig
from endotsr.method.splatting.camera import Camera
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings, real_of
from endotsr.port.operations.requests import Tape, config_of, gaussians_of, initialisation_of, model_of, sequence_of
from endotsr.training.fitting import schedules
from endotsr.training.fitting.adam import AdamState, adam_state, adam_update, regather
from endotsr.training.fitting.objective import calibrate_on
from endotsr.training.fitting.state import TrainingState, training_constants
from endotsr.training.fitting.trainer import training_step
from endotsr.training.scene.density_control import densify, empty_statistics, gather_statistics, scene_extent
from endotsr.training.scene.gaussians import Gaussians, arrays
from endotsr.training.scene.initialisation import initialise
from endotsr.training.scene.parameters import frame_parameters, trained

RESIDUAL_RATES = ("appearance_coefficients", "motion_coefficients")
CONSTANT_LENS = {"fx": 1.0, "fy": 1.0, "cx": 0.0, "cy": 0.0, "width": 1, "height": 1}  # the extent uses poses only


def _adam(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    """Successive steps with the gradients of the leading axis."""
    parameter = inputs["parameter"].copy()
    state = AdamState({"p": np.zeros_like(parameter)}, {"p": np.zeros_like(parameter)}, {"p": 0})
    numbers = [settings[name] for name in ("beta1", "beta2", "epsilon")]
    for gradient in inputs["gradients"]:
        adam_update(state, {"p": parameter}, {"p": np.ascontiguousarray(gradient)}, {"p": settings["rate"]}, *numbers)
    return {"parameter_after": parameter, "first": state.first["p"], "second": state.second["p"]}, None


def _rates(module: Any, iteration: int, config: Config) -> dict[str, float]:
    """Rates by group; rates of absent residuals are 0."""
    rates: dict[str, Any] = dict.fromkeys(RESIDUAL_RATES, 0.0) | module.learning_rates(iteration, config)
    for name, parts in (("harmonics", ("base", "rest")), ("fdm_weight", ("position", "other"))):
        for part, (_, rate) in zip(parts, rates.pop(name)):
            rates[f"{name}_{part}"] = rate
    return rates


def _schedule(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    config, iterations = config_of(settings, np.dtype(np.float64)), [int(i) for i in inputs["iteration"]]
    rows = [_rates(module, i, config) for i in iterations]
    found: dict[str, NDArray] = {f"rate_{name}": np.array([row[name] for row in rows]) for name in rows[0]}
    assert isinstance(config.loss.lambda_lap, float)
    return found | {
        "laplacian_weight": np.array([config.loss.lambda_lap * module.laplacian_ramp(i, config) for i in iterations]),
        "degree": np.array([module.active_degree(i, config) for i in iterations], np.int64),
        "residuals": np.array([module.residuals_active(i, config) for i in iterations]),
        "smoothness": np.array([module.smoothness_active(i, config) for i in iterations]),
        "gathers": np.array([module.statistics_active(i, config) for i in iterations]),
        "densifies": np.array([module.densify_now(i, config) for i in iterations]),
    }, None


def _density(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    """Statistics of some views, then one densification. Harmonics are set to indices, first moments to 1."""
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
    made = densify(gaussians, statistics, config, tape, extent)
    regather(moments, arrays(gaussians), made.plan.source, made.plan.survivors)
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
        "moments_kept": moments.first["opacity_logit"] == 1.0,
        "position_after": made.gaussians.position,
        "log_scale_after": made.gaussians.log_scale,
    }, None


def _initialisation(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    """Selects every candidate; no random number is drawn."""
    config = initialisation_of(settings)
    sequence, no_draw = sequence_of(inputs, settings["camera"]), None
    found = initialise(sequence, config, model_of(settings), no_draw, real_of(inputs))  # type: ignore[arg-type]
    return {"count": np.array(found.count), **arrays(found)}, None


def _training(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    """Train, with activation of A and S and with densification. `auto` calibrates on the first Gaussians."""
    dtype = real_of({"position": inputs["position"]})
    config = config_of(settings, dtype)
    sequence = sequence_of(inputs, settings["camera"])
    gaussians = Gaussians(**{name: a.copy() for name, a in arrays(gaussians_of(inputs)).items()})
    constants = training_constants(sequence, config)
    given = config.loss.lambda_lap
    weight = (
        calibrate_on(gaussians, constants.spectral, sequence, config).lambda_lap if given == "auto" else float(given)
    )
    tape: Any = Tape(inputs["frame_order"], inputs["split_noise"])
    frames = frame_parameters(config.model, sequence.times[sequence.train_index], dtype)
    moments = adam_state(arrays(gaussians) | trained(frames))
    state = TrainingState(gaussians, moments, 0, tape, empty_statistics(gaussians.count), weight, frames)
    log = [training_step(state, constants) | _sizes(state) for _ in range(config.training.iterations)]
    series = SERIES | squares_of(trained(frames))
    found: dict[str, NDArray] = {name: np.array([entry.get(key, 0.0) for entry in log]) for name, key in series.items()}
    found |= {f"final_{name}": a for name, a in (arrays(state.gaussians) | trained(frames)).items()}
    return found | {
        "lambda_lap": weight,
        "count": np.array([entry["gaussians"] for entry in log] + [state.gaussians.count], np.int64),
    }, None


def _sizes(state: TrainingState) -> dict[str, float]:
    """The state of a trajectory after an iteration: sums over all entries, 0 for a missing array."""
    parameters = arrays(state.gaussians) | trained(state.frames)
    squares = {f"square_{name}": _total(array * array) for name, array in parameters.items()}
    return squares | {
        "first_moments": sum(_total(abs(array)) for array in state.adam.first.values()),
        "second_moments": sum(_total(array) for array in state.adam.second.values()),
        "gradient_sum": _total(state.statistics.gradient_sum),
        "visits": _total(state.statistics.visits),
    }


def squares_of(names: Iterable[str]) -> dict[str, str]:
    """The sums of the squares of frame parameters, as in `SERIES`: asked of a case that has them."""
    return {f"square_{name}": f"square_{name}" for name in names}


def _total(array: NDArray) -> float:
    return float(array.sum(dtype=np.float64))


TERMS = {"term_l1": "l1", "term_ssim": "ssim", "term_depth": "depth",
         "term_smoothness": "smoothness", "term_laplacian": "laplacian",
         "term_penalty": "matern_penalty"}  # fmt: skip
SQUARES = tuple(f"square_{name}" for name in Gaussians._fields)
STATE = ("first_moments", "second_moments", "gradient_sum", "visits")
SERIES = TERMS | {name: name for name in ("loss", *SQUARES, *STATE)}  # output: entry of the log

OPERATIONS = [
    Operation(
        name="adam",
        equation="B10",
        text="optimiser steps with given gradients",
        function="endotsr.training.fitting.adam.adam_update",
        forward=_adam,
    ),
    Operation(
        name="schedule",
        equation="B10",
        text="rates, weights and switches of some iterations",
        function="endotsr.training.fitting.schedules.learning_rates",
        forward=partial(_schedule, schedules),
    ),
    Operation(
        name="density",
        equation="B11",
        text="statistics of some views, one densification",
        function="endotsr.training.scene.density_control.densify",
        forward=_density,
    ),
    Operation(
        name="initialisation",
        equation="B12",
        text="Gaussians from depth maps",
        function="endotsr.training.scene.initialisation.initialise",
        forward=_initialisation,
    ),
    Operation(
        name="training",
        equation="6",
        text="calibration and some iterations",
        function="endotsr.training.fitting.trainer.training_step",
        forward=_training,
    ),
]
