"""The twin of every stage: the same inputs and outputs, computed by `endotsr.definition` in plain NumPy, in float64.

`definition_stages` drives the comparison of every compiled function with its definition, the gradient check of the
definition and the comparison of the golden values with it.
"""

import importlib
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config, DensityConfig, LossConfig
from endotsr.definition import (
    adam,
    calibration,
    compositing,
    covariance,
    density_control,
    depth,
    dictionary,
    initialisation,
    laplacian,
    masked_ssim,
    matern,
    objective,
    pose,
    projection,
    render,
    schedules,
    train,
    view,
)
from endotsr.definition import scene as moving
from endotsr.fitting.model import raster_settings
from endotsr.opencv import canny_edges
from endotsr.stages.optimiser import CONSTANT_LENS, RESIDUAL_RATES, SERIES
from endotsr.stages.registry import all_stages
from endotsr.stages.requests import Tape, camera_of, config_of, initialisation_of, model_of, raster_of, sequence_of
from endotsr.stages.stage import Found, Inputs, Settings, Stage

IMAGES = ("colour_image", "depth_image", "opacity_image")


class Twin(NamedTuple):
    """What replaces the functions of a stage."""

    function: Any  # of the definition
    forward: Callable[[Inputs, Settings], tuple[Found, Any]]
    reverse: Callable[[Inputs, Any], Found] | None = None
    extra: Callable[[Inputs, Settings, Any], Found] | None = None


def definition_stages() -> dict[str, Stage]:
    """Every stage that the definition computes, by name, with its functions in place of the compiled ones.

    The discrete decisions are those of the compiled stage. Variants that differ in the compiled function only are left
    out.
    """
    stages, made = all_stages(), {}
    for name, twin in twins().items():
        stage, dotted = stages[name], f"{twin.function.__module__}.{twin.function.__name__}"
        variants = tuple(variant for variant in stage.variants if not variant.settings.get("_compositor") == "blocks")
        variants = variants or stage.variants
        trace = None if stage.trace is None else _trace_of(stage)
        made[name] = stage._replace(
            function=dotted, forward=twin.forward, reverse=twin.reverse, extra=twin.extra, trace=trace,
            variants=tuple(variant._replace(function="") for variant in variants),
        )  # fmt: skip
    return made


def twins() -> dict[str, Twin]:
    """The twin of every stage that the definition computes; that of a plain pair is found by its names."""
    stages = all_stages()
    return {name: twin_of(stage) for name, stage in stages.items() if name in TWINS or stage.plain}


def twin_of(stage: Stage) -> Twin:
    """The twin of a stage. Raises KeyError for a stage that is written out and is not in `TWINS`."""
    pair = stage.plain
    if pair is None:
        return TWINS[stage.name]
    module = importlib.import_module(f"endotsr.definition.{pair.forward.__module__.rpartition('.')[2]}")
    own = pair._replace(forward=getattr(module, pair.forward.__name__), reverse=getattr(module, pair.reverse.__name__))
    return Twin(own.forward, own.run, own.back)


def _trace_of(stage: Stage) -> Callable[[Inputs, Settings, Any], Any]:
    """The decisions of the compiled stage at some inputs, whatever was saved."""
    trace = stage.trace
    assert trace is not None
    return lambda inputs, settings, saved: trace(inputs, settings, stage.forward(inputs, settings)[1])


def _of(arrays: Inputs, names: tuple[str, ...]) -> list[Any]:
    """Some arrays, in this order."""
    return [arrays[name] for name in names]


# ---- the paper ----


def _frequencies(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    return {"omega": dictionary.frequencies(settings["count"], settings["low"], settings["high"])}, None


def _atoms(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    statistics = dictionary.atom_statistics(inputs["times"][inputs["train_index"]], inputs["omega"])
    phi_bar, saved = dictionary.normalise_forward(inputs["phi"], statistics)
    return {"phi_bar": phi_bar}, saved


def _atoms_reverse(cotangents: Inputs, saved: Any) -> Found:
    return {"d_phi": dictionary.normalise_reverse(cotangents["phi_bar"], saved)}


def _statistics(inputs: Inputs, settings: Settings, saved: Any) -> Found:
    return {"mean": saved.mean, "rms": np.where(saved.dead, 0, saved.rms), "dead": saved.dead}


def _matern(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    rho = matern.matern_weights(inputs["omega"], settings["correlation_length"])
    penalty, saved = matern.matern_penalty_forward(inputs["motion_coefficients"], rho)
    return {"penalty": penalty}, saved


def _matern_reverse(cotangents: Inputs, saved: Any) -> Found:
    return {"d_motion_coefficients": matern.matern_penalty_reverse(cotangents["penalty"], saved)}


def _laplacian(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    masks = laplacian.support_masks(inputs["mask"], settings["levels"], settings["upsampling"])
    images = inputs["rendered"], inputs["observed"]
    loss, saved = laplacian.laplacian_loss_forward(*images, masks, settings["upsampling"])
    return {"loss": loss}, saved


def _laplacian_reverse(cotangents: Inputs, saved: Any) -> Found:
    return {"d_rendered": laplacian.laplacian_loss_reverse(cotangents["loss"], saved)}


def _bands(inputs: Inputs, settings: Settings, saved: Any) -> Found:
    bands = laplacian.laplacian_levels(inputs["observed"], settings["levels"], settings["upsampling"]).bands
    found = {f"band_{j}": band for j, band in enumerate(bands, start=1)}
    return found | {f"valid_{j}": valid for j, valid in enumerate(saved.masks.bands, start=1)}


def _calibration(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    g_rgb, g_lap = (np.array([calibration.rms(view) for view in inputs[f"d_{name}"]]) for name in _GRADIENT_IMAGES)
    views = [(str(k), *pair) for k, pair in enumerate(zip(g_rgb, g_lap))]
    try:
        weight, refused = calibration.calibrate(views, settings["gradient_ratio"]).lambda_lap, False
    except ValueError:
        weight, refused = 0.0, True
    return {"g_rgb": g_rgb, "g_lap": g_lap, "lambda_lap": weight, "refused": np.array(refused)}, None


_GRADIENT_IMAGES = ("photometric", "laplacian")


# ---- from raw Gaussians to images ----


def _covariance(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    shape, saved = covariance.covariance_forward(inputs["quaternion"], inputs["log_scale"])
    return shape._asdict(), saved


def _covariance_reverse(cotangents: Inputs, saved: Any) -> Found:
    return covariance.covariance_reverse(covariance.Shape(**cotangents), saved)._asdict()


def _projection(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    shape = covariance.Shape(inputs["rotation"], inputs["scale"])
    out, saved = projection.projection_forward(
        inputs["position"], shape, camera_of(inputs, settings), raster_of(settings)
    )
    return {"mean2d": out.mean2d, "covariance2d": out.covariance2d, "depth": out.depth}, saved


def _projection_reverse(cotangents: Inputs, saved: Any) -> Found:
    given = _of(cotangents, ("mean2d", "covariance2d", "depth"))
    *grads, (d_rotation, d_translation) = projection.projection_reverse(*given, saved=saved)
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
    return compositing.composite_reverse(*_of(cotangents, IMAGES), saved=saved)._asdict()


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


# ---- losses and corrections ----


def _ssim(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    target = masked_ssim.ssim_target(inputs["observed"], inputs["mask"])
    ssim, saved = masked_ssim.masked_ssim_forward(inputs["rendered"], target)
    return {"ssim": ssim}, saved


def _ssim_reverse(cotangents: Inputs, saved: Any) -> Found:
    return {"d_rendered": masked_ssim.masked_ssim_reverse(cotangents["ssim"], saved)}


def _depth(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    target = depth.depth_target(inputs["prior_depth"], inputs["mask"])
    loss, saved = depth.normalised_depth_forward(inputs["rendered_depth"], target)
    return {"loss": loss}, saved


def _depth_reverse(cotangents: Inputs, saved: Any) -> Found:
    return {"d_rendered_depth": depth.normalised_depth_reverse(cotangents["loss"], saved)}


def _pose(inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    given = _of(inputs, ("rotation", "translation", "rotation_vector", "offset"))
    rotation, translation, saved = pose.pose_forward(*given)
    return {"corrected_rotation": rotation, "corrected_translation": translation}, saved


def _pose_reverse(cotangents: Inputs, saved: Any) -> Found:
    given = _of(cotangents, ("corrected_rotation", "corrected_translation"))
    return pose.pose_reverse(*given, saved=saved)._asdict()


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
    weights = objective.LossWeights(loss.ssim_weight, loss.depth_weight, loss.smoothness_weight, laplacian)
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


def _schedule(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    config, iterations = config_of(settings, np.dtype(np.float64)), [int(i) for i in inputs["iteration"]]
    rows: list[dict[str, Any]] = []
    for i in iterations:
        row: dict[str, Any] = dict.fromkeys(RESIDUAL_RATES, 0.0) | schedules.learning_rates(i, config)
        for name, parts in (("harmonics", ("base", "rest")), ("fdm_weight", ("position", "other"))):
            row |= {f"{name}_{part}": rate for part, (_, rate) in zip(parts, row.pop(name))}
        rows.append(row)
    assert isinstance(config.loss.lambda_lap, float)
    return {f"rate_{name}": np.array([row[name] for row in rows]) for name in rows[0]} | {
        "laplacian_weight": config.loss.lambda_lap
        * np.array([schedules.laplacian_ramp(i, config) for i in iterations]),
        "degree": np.array([schedules.active_degree(i, config) for i in iterations]),
        "residuals": np.array([schedules.residuals_active(i, config) for i in iterations]),
        "smoothness": np.array([schedules.smoothness_active(i, config) for i in iterations]),
        "gathers": np.array([schedules.statistics_active(i, config) for i in iterations]),
        "densifies": np.array([schedules.densify_now(i, config) for i in iterations]),
    }, None


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
    state, tape, log = train.start(gaussians), Tape(inputs["frame_order"], inputs["split_noise"]), []
    counts = [gaussians.opacity_logit.size]
    for _ in range(config.training.iterations):
        state, seen = train.iterate(state, sequence, spectral, config, tape, raster, canny_edges)
        log.append({"loss": seen.loss, **seen.terms, **_sizes(state)})
        counts.append(state.gaussians.opacity_logit.size)
    found: dict[str, Any] = {name: np.array([entry.get(key, 0.0) for entry in log]) for name, key in SERIES.items()}
    found |= {f"final_{name}": array for name, array in moving.arrays(state.gaussians).items()}
    return found | {"lambda_lap": weight, "count": np.array(counts)}, None


def _sizes(state: Any) -> dict[str, NDArray]:
    """Sums over all entries of the state after an iteration."""
    moments = list(state.adam.values())
    return {f"square_{name}": (array**2).sum() for name, array in moving.arrays(state.gaussians).items()} | {
        "first_moments": sum(np.abs(m).sum() for m, _, _ in moments),
        "second_moments": sum(v.sum() for _, v, _ in moments),
        "gradient_sum": state.statistics.gradient_sum.sum(),
        "visits": state.statistics.visits.sum(),
    }


TWINS: dict[str, Twin] = {
    "frequencies": Twin(dictionary.frequencies, _frequencies),
    "atoms": Twin(dictionary.normalise_forward, _atoms, _atoms_reverse, _statistics),
    "matern": Twin(
        matern.matern_penalty_forward, _matern, _matern_reverse, lambda inputs, settings, saved: {"rho": saved.rho}
    ),
    "laplacian": Twin(laplacian.laplacian_loss_forward, _laplacian, _laplacian_reverse, _bands),
    "calibration": Twin(calibration.calibrate, _calibration),
    "covariance": Twin(covariance.covariance_forward, _covariance, _covariance_reverse),
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
    "masked_ssim": Twin(masked_ssim.masked_ssim_forward, _ssim, _ssim_reverse),
    "normalised_depth": Twin(depth.normalised_depth_forward, _depth, _depth_reverse),
    "pose": Twin(pose.pose_forward, _pose, _pose_reverse),
    "scene": Twin(moving.scene_at, _scene),
    "objective": Twin(view.view_gradients, _objective, _objective_reverse, _images_and_terms),
    "adam": Twin(adam.adam_update, _adam),
    "schedule": Twin(schedules.learning_rates, _schedule),
    "density": Twin(density_control.densify, _density),
    "initialisation": Twin(initialisation.initialise, _initialisation),
    "training": Twin(train.iterate, _training),
}
