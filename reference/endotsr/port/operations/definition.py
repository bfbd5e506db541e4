"""The twin of every operation: the same inputs and outputs, by `endotsr.definition` in plain NumPy, in float64.

`definition_operations` is used to compare every compiled function with its definition, to check the gradients of the
definition, and to compare golden values with it.
"""

import importlib
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import canny_edges
from endotsr.config import Config, DensityConfig, LossConfig
from endotsr.definition import (
    adam,
    compositing,
    covariance,
    density_control,
    initialisation,
    legacy,
    objective,
    projection,
    render,
    train,
    view,
)
from endotsr.definition import scene as moving
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings
from endotsr.port.operations.optimiser import CONSTANT_LENS, SERIES, squares_of
from endotsr.port.operations.registry import method_operations
from endotsr.port.operations.requests import (
    Tape,
    camera_of,
    config_of,
    initialisation_of,
    model_of,
    raster_of,
    sequence_of,
)
from endotsr.training.fitting.model import raster_settings
from endotsr.training.fitting.objective import full_weights

IMAGES = ("colour_image", "depth_image", "opacity_image")


class Twin(NamedTuple):
    """Functions that replace the functions of an operation."""

    function: Any  # of the definition
    forward: Callable[[Inputs, Settings], tuple[Found, Any]]
    reverse: Callable[[Inputs, Any], Found] | None = None
    extra: Callable[[Inputs, Settings, Any], Found] | None = None


def definition_operations() -> dict[str, Operation]:
    """Every operation computed by the definition, by name, with its functions instead of the compiled ones.

    Discrete decisions come from the compiled operation. Variants that differ only in the compiled function are omitted.
    """
    operations, made = method_operations(), {}
    for name, twin in twins().items():
        operation, dotted = operations[name], f"{twin.function.__module__}.{twin.function.__name__}"
        variants = tuple(
            variant for variant in operation.variants if not variant.settings.get("_compositor") == "blocks"
        )
        variants = variants or operation.variants
        trace = None if operation.trace is None else _trace_of(operation)
        made[name] = operation._replace(
            function=dotted, forward=twin.forward, reverse=twin.reverse, extra=twin.extra, trace=trace,
            variants=tuple(variant._replace(function="") for variant in variants),
        )  # fmt: skip
    return made


def twins() -> dict[str, Twin]:
    """The twin of every operation computed by the definition."""
    operations = method_operations()
    return {n: twin_of(s) for n, s in operations.items() if n in TWINS or s.plain or isinstance(s.forward, partial)}


def twin_of(operation: Operation) -> Twin:
    """The twin of an operation, with the module of the definition that has the name of the compiled module.

    Raises: KeyError for an operation without a module that is not in `TWINS`.
    """
    package, _, name = operation.function.rpartition(".")
    if operation.name in TWINS:
        return TWINS[operation.name]
    module = importlib.import_module(f"endotsr.definition.{package.rpartition('.')[2]}")
    if (pair := operation.plain) is not None:
        forward, reverse = (getattr(module, function.__name__) for function in (pair.forward, pair.reverse))
        own = pair._replace(forward=forward, reverse=reverse)
        return Twin(forward, own.run, own.back)
    if not isinstance(operation.forward, partial):
        raise KeyError(operation.name)
    parts = (operation.forward, operation.reverse, operation.extra)
    bound = (partial(part.func, module) if isinstance(part, partial) else None for part in parts)
    return Twin(getattr(module, name), *bound)  # type: ignore[arg-type]


def _trace_of(operation: Operation) -> Callable[[Inputs, Settings, Any], Any]:
    """The decisions of the compiled operation at some inputs; ignores the saved tuple."""
    trace = operation.trace
    assert trace is not None
    return lambda inputs, settings, saved: trace(inputs, settings, operation.forward(inputs, settings)[1])


def _of(arrays: Inputs, names: tuple[str, ...]) -> list[Any]:
    """Some arrays, in this order."""
    return [arrays[name] for name in names]


# ---- from raw Gaussians to images ----


def _projection(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    shape = covariance.Shape(inputs["rotation"], inputs["scale"])
    out, saved = projection.projection_forward(
        inputs["position"], shape, camera_of(inputs, settings), raster_of(settings)
    )
    return {"mean2d": out.mean2d, "covariance2d": out.covariance2d, "depth": out.depth}, saved


def _projection_reverse(cotangents: Inputs, saved: Any) -> Found:
    given = _of(cotangents, ("mean2d", "covariance2d", "depth"))
    *grads, (d_rotation, d_translation) = legacy.projection_reverse(*given, saved=saved)
    named = dict(zip(("d_position", "d_rotation", "d_scale"), grads))
    return named | {"d_rotation_matrix": d_rotation, "d_translation": d_translation}


def _composite(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    a, b, c = inputs["covariance2d"]
    seen = np.ones(a.size, bool)
    screen = projection.Projected(inputs["mean2d"], inputs["covariance2d"], a * c - b * b, inputs["depth"], seen)
    out, saved = compositing.composite_forward(
        screen, inputs["opacity_logit"], inputs["colour"], raster_of(settings), inputs["background"],
        settings["width"], settings["height"],
    )  # fmt: skip
    return dict(zip(IMAGES, out)), saved


def _composite_reverse(cotangents: Inputs, saved: Any) -> Found:
    return legacy.composite_reverse(*_of(cotangents, IMAGES), saved=saved)._asdict()


def _render(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    scene = render.Scene._make(inputs.get(name) for name in render.Scene._fields)
    out, saved = render.render_forward(
        scene, camera_of(inputs, settings), raster_of(settings), degree=settings["degree"],
        background=inputs["background"],
    )  # fmt: skip
    return dict(zip(IMAGES, out)), saved


def _render_reverse(cotangents: Inputs, saved: Any) -> Found:
    found = render.render_reverse(*_of(cotangents, IMAGES), saved=saved)._asdict()
    d_rotation, d_translation = found.pop("d_camera")
    return found | {"d_rotation_matrix": d_rotation, "d_translation": d_translation}


# ---- the whole method ----


def _gaussians(inputs: Inputs) -> Any:
    return moving.Gaussians._make(inputs.get(name) for name in moving.Gaussians._fields)


def _spectral(inputs: Inputs, settings: Settings) -> Any:
    return moving.spectral_from(model_of(settings), inputs["times"][inputs["train_index"]])


def _scene(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    model = model_of(settings)
    scene, saved = moving.scene_at(_gaussians(inputs), _spectral(inputs, settings), model, settings["t"])
    return {f"{name}_at_t": getattr(scene, name) for name in ("position", "quaternion", "log_scale", "residual")}, saved


def _objective(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    raster: Any = raster_of(settings)
    loss, camera = msgspec.convert(settings["loss"], LossConfig), camera_of(inputs, settings)
    assert isinstance(loss.lambda_lap, float)
    config = Config(model=model_of(settings), loss=loss)
    frame = objective.Frame(inputs["observed"], inputs["mask"], inputs["prior_depth"], settings["t"], camera)
    laplacian = loss.lambda_lap if config.model.laplacian else 0.0
    weights = objective.LossWeights(*full_weights(loss, laplacian))
    exposed = (inputs["exposure_log_gain"], inputs["exposure_bias"]) if "exposure_bias" in inputs else None
    found = view.view_gradients(
        _gaussians(inputs), _spectral(inputs, settings), objective.frame_targets(frame, config), weights, config,
        camera, settings["t"], inputs.get("edges", canny_edges), exposure=exposed, raster=raster,
        degree=settings["degree"],
    )  # fmt: skip
    return {"objective": found.loss}, found


def _objective_reverse(cotangents: Inputs, saved: Any) -> Found:
    d_exposure = zip(("exposure_log_gain", "exposure_bias"), saved.d_exposure or ())
    gradients = saved.gradients | dict(d_exposure)
    return {f"d_{name}": array * cotangents["objective"] for name, array in gradients.items()}


def _images_and_terms(inputs: Inputs, settings: Settings, saved: Any) -> Found:
    terms = {f"term_{name.removeprefix('matern_')}": value for name, value in saved.terms.items()}
    return terms | {"colour_image": saved.rendered.colour, "depth_image": saved.rendered.depth}


def _adam(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    parameters, numbers = {"p": inputs["parameter"]}, [settings[name] for name in ("beta1", "beta2", "epsilon")]
    state = adam.adam_state(parameters)
    for gradient in inputs["gradients"]:
        state, parameters = adam.adam_update(state, parameters, {"p": gradient}, {"p": settings["rate"]}, *numbers)
    return {"parameter_after": parameters["p"], "first": state["p"][0], "second": state["p"][1]}, None


def _density(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    config, count = msgspec.convert(settings["density"], DensityConfig), inputs["opacity_logit"].size
    raw = _of(inputs, ("position", "quaternion", "log_scale", "opacity_logit"))
    gaussians, statistics = (
        moving.Gaussians(*raw, harmonics=np.zeros((1, 3, count))),
        density_control.empty_statistics(count),
    )
    for d_mean, visible in zip(inputs["d_mean2d"], inputs["visible"]):
        statistics = density_control.gather_statistics(
            statistics, d_mean, visible, settings["width"], settings["height"]
        )
    poses = zip(inputs["rotation_matrices"], inputs["translations"])
    cameras = [projection.Camera(*pose, *CONSTANT_LENS.values()) for pose in poses]
    extent, tape = density_control.scene_extent(config, cameras), Tape(np.zeros(0), inputs["split_noise"])
    made = density_control.densify(gaussians, statistics, config, tape, extent)
    parent, survivors = made.plan
    cloned, split = np.split(parent[survivors : survivors + made.cloned + made.split], [made.cloned])
    rows = np.arange(count)
    return {
        "extent": extent,
        "mean_gradient": statistics.gradient_sum / np.maximum(statistics.visits, 1),
        "pruned": ~np.isin(rows, parent),
        "cloned": np.isin(rows, cloned),
        "split": np.isin(rows, split),
        "count": np.array(parent.size),
        "parent": parent,
        "moments_kept": np.arange(parent.size) < survivors,
        "position_after": made.gaussians.position,
        "log_scale_after": made.gaussians.log_scale,
    }, None


def _initialisation(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    config = initialisation_of(settings)
    sequence = sequence_of(inputs, settings["camera"])
    found = initialisation.initialise(sequence, config, model_of(settings), None)
    return {"count": np.array(found.opacity_logit.size), **moving.arrays(found)}, None


def _training(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    config, sequence = config_of(settings, np.dtype(np.float64)), sequence_of(inputs, settings["camera"])
    raster: Any = raster_settings(config)
    gaussians = _gaussians(inputs)
    spectral = moving.spectral_from(config.model, sequence.times[sequence.train_index])
    given = config.loss.lambda_lap
    weight = train.calibrated_weight(gaussians, spectral, sequence, config, raster) if given == "auto" else given
    config = msgspec.structs.replace(config, loss=msgspec.structs.replace(config.loss, lambda_lap=float(weight)))
    exposures = train.no_exposures(config.model, len(sequence.train_index))
    state, tape, log = train.start(gaussians, exposures), Tape(inputs["frame_order"], inputs["split_noise"]), []
    counts = [gaussians.opacity_logit.size]
    for _ in inputs["frame_order"]:  # one iteration per frame
        state, seen = train.iterate(state, sequence, spectral, config, tape, raster, canny_edges)
        log.append({"loss": seen.loss, **seen.terms, **_sizes(state)})
        counts.append(state.gaussians.opacity_logit.size)
    series = SERIES | squares_of(exposures)
    found: dict[str, NDArray] = {name: np.array([entry.get(key, 0.0) for entry in log]) for name, key in series.items()}
    found |= {f"final_{name}": array for name, array in (moving.arrays(state.gaussians) | state.exposures).items()}
    return found | {"lambda_lap": weight, "count": np.array(counts)}, None


def _sizes(state: Any) -> dict[str, NDArray]:
    """Sums over all entries of the state after an iteration."""
    moments, parameters = list(state.adam.values()), moving.arrays(state.gaussians) | state.exposures
    return {f"square_{name}": (array**2).sum() for name, array in parameters.items()} | {
        "first_moments": sum(np.abs(m).sum() for m, _, _ in moments),
        "second_moments": sum(v.sum() for _, v, _ in moments),
        "gradient_sum": state.statistics.gradient_sum.sum(),
        "visits": state.statistics.visits.sum(),
    }


TWINS: dict[str, Twin] = {
    "projection": Twin(
        projection.projection_forward,
        _projection,
        _projection_reverse,
        lambda inputs, settings, saved: {"visible": saved.visible},
    ),
    "composite": Twin(compositing.composite_forward, _composite, _composite_reverse),
    "render": Twin(
        render.render_forward,
        _render,
        _render_reverse,
        lambda inputs, settings, saved: {"visible": saved.visible},
    ),
    "scene": Twin(moving.scene_at, _scene),
    "objective": Twin(view.view_gradients, _objective, _objective_reverse, _images_and_terms),
    "adam": Twin(adam.adam_update, _adam),
    "density": Twin(density_control.densify, _density),
    "initialisation": Twin(initialisation.initialise, _initialisation),
    "training": Twin(train.iterate, _training),
}
