"""Operations of the whole method: the moving scene, the objective (6) with every gradient, and its repetition."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.filters import canny_edges
from endotsr.clips.sequences.sequence import Frame
from endotsr.config import Config, LossConfig, ModelConfig
from endotsr.port.operations import laplacian, losses
from endotsr.port.operations.compositing import render_decisions
from endotsr.port.operations.laplacian import LEVELS
from endotsr.port.operations.made_up import COUNT, HEIGHT, LENS, WIDE, WIDTH, pose, raw_gaussians
from endotsr.port.operations.operation import Blocks, Found, Inputs, Operation, Settings, Variant, split_blocks
from endotsr.port.operations.requests import (
    camera_of,
    compositor_of,
    gaussians_of,
    model_of,
    raster_dict,
    raster_of,
    spectral_of,
)
from endotsr.training.fitting.model import SceneSaved, scene_at
from endotsr.training.fitting.objective import frame_targets, full_weights
from endotsr.training.fitting.view import ViewGradients, view_gradients
from endotsr.training.scene.parameters import Exposure

BASES, FREQUENCIES = 3, 2


# ---- the moving scene ----


def _scene(inputs: Inputs, settings: Settings) -> tuple[Found, SceneSaved]:
    model = model_of(settings)
    scene, saved = scene_at(gaussians_of(inputs), spectral_of(inputs, settings), model, settings["t"])
    names = ("position", "quaternion", "log_scale", "residual")
    return {f"{name}_at_t": getattr(scene, name) for name in names}, saved


# ---- the objective (6) ----


def _objective(inputs: Inputs, settings: Settings) -> tuple[Found, ViewGradients]:
    """Equation (6) of one view. Edges of the smoothness term are detected unless the request has them."""
    loss, camera = msgspec.convert(settings["loss"], LossConfig), camera_of(inputs, settings)
    assert isinstance(loss.lambda_lap, float)
    config = Config(model=model_of(settings), loss=loss)
    frame = Frame(inputs["observed"], inputs["mask"], inputs["prior_depth"], settings["t"], camera)
    weights = full_weights(loss, loss.lambda_lap)
    view = view_gradients(
        gaussians_of(inputs), spectral_of(inputs, settings), frame_targets(frame, config), weights, config, camera,
        settings["t"], inputs.get("edges"), exposure=_exposure(inputs), raster=raster_of(settings),
        degree=settings["degree"], compositor=compositor_of(settings),
    )  # fmt: skip
    return {"objective": view.loss}, view


def _exposure(inputs: Inputs) -> Exposure | None:
    """The exposure of the frame, if the request has one."""
    given = "exposure_log_gain" in inputs
    return Exposure(inputs["exposure_log_gain"], inputs["exposure_bias"]) if given else None


def _objective_reverse(cotangents: Inputs, view: ViewGradients) -> Found:
    """The gradients of the view, times the cotangent of the loss."""
    up = float(cotangents["objective"])
    d_exposure = {} if view.d_exposure is None else view.d_exposure._asdict()
    gradients = view.gradients | {f"exposure_{name}": array for name, array in d_exposure.items()}
    return {f"d_{name}": array * array.dtype.type(up) for name, array in gradients.items()}


def _images_and_terms(inputs: Inputs, settings: Settings, view: ViewGradients) -> Found:
    """Images and unweighted terms; a term of weight 0 is not evaluated."""
    names = {"matern_penalty": "penalty"}
    terms = {f"term_{names.get(name, name)}": value for name, value in view.terms.items()}
    return terms | {"colour_image": view.rendered.colour, "depth_image": view.rendered.depth}


def _objective_trace(inputs: Inputs, settings: Settings, view: ViewGradients) -> dict[str, NDArray]:
    """Decisions of the render, the edges, and what the operation of each loss decides at the rendered images."""
    (colour, depth, _), fixed = view.rendered, {**settings["loss"], "levels": LEVELS}
    edges = canny_edges(depth)
    seen = {"rendered": colour, "rendered_depth": depth, "edges": edges, **inputs}
    found = render_decisions(view.render_saved) | {"edges": edges.astype(int)}
    for operation in (*losses.OPERATIONS, *laplacian.OPERATIONS):
        if operation.trace is not None:
            decided = operation.trace(seen, fixed, operation.forward(seen, fixed)[1])
            found |= {f"{operation.name} {name}": array for name, array in decided.items()}
    return found


def _objective_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Every component nonzero, because gradients vanish at zero coefficients."""
    scene = raw_gaussians(rng)
    del scene["residual"]
    shape = (10, BASES, COUNT)
    centres = np.linspace(0.1, 0.7, BASES)[None, :, None] + rng.uniform(-0.05, 0.05, shape)
    return scene | {
        "fdm_weight": rng.normal(0, 0.05, shape),
        "fdm_centre": centres,
        "fdm_width": rng.uniform(0.3, 0.5, shape),
        "appearance_coefficients": rng.normal(0, 0.3, (3, 2 * FREQUENCIES, COUNT)),
        "motion_coefficients": rng.normal(0, 0.03, (3, 2 * FREQUENCIES, COUNT)),
        "exposure_log_gain": rng.normal(0, 0.1, 3),
        "exposure_bias": rng.normal(0, 0.05, 3),
    }


def _frame(dtype: np.dtype) -> dict[str, NDArray]:
    """A fixed observed frame with an excluded corner and two pixels without depth; twelve stamps; the camera."""
    rng = np.random.default_rng(5)
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[:3, :4] = False
    depth = rng.uniform(2.0, 5.0, (HEIGHT, WIDTH)).astype(dtype)
    depth[8, 8] = depth[9, 3] = 0
    image = rng.uniform(0.1, 0.9, (3, HEIGHT, WIDTH)).astype(dtype)
    stamps = {"times": np.arange(12) / 12, "train_index": np.arange(12)}
    return {"observed": image, "mask": mask, "prior_depth": depth} | stamps | pose()


def _objective_blocks(inputs: Inputs) -> Blocks:
    """Blocks: channels of the deformation, frequencies of the residuals, every other array whole."""
    channels = {"position": slice(0, 3), "quaternion": slice(3, 7), "log-scale": slice(7, 10)}
    parts = {f"fdm_{part}": {f"fdm {part} {name}": index for name, index in channels.items()}
             for part in ("weight", "centre", "width")}  # fmt: skip
    for name in ("appearance_coefficients", "motion_coefficients"):
        parts[name] = {f"{name} frequency {f}": np.s_[:, [f, f + FREQUENCIES]] for f in range(FREQUENCIES)}  # type: ignore[misc]
    return split_blocks(parts)(inputs)


CHECKED = {
    "t": 0.37,
    "degree": 3,
    "camera": LENS,
    "raster": raster_dict(WIDE),
    "model": msgspec.to_builtins(ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.2)),
    "loss": {
        **{name: 0.5 for name in LossConfig.__struct_fields__ if name.endswith("_weight")},
        "ssim_weight": 0.3,
        "depth_weight": 1.0,
        "smoothness_weight": 0.05,
        "total_variation_factor": 2.0,
        "lambda_msp": 1.0,
        "lambda_lap": 0.8,
        "upsampling": "co_sited",
    },
    "_compositor": "blocks",
}


# ---- determinism ----


def _twice(inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    """The objective twice: the results must be bitwise equal."""
    first, second = (OBJECTIVE.compute(inputs, settings) for _ in range(2))
    return {f"{name}_1": first[name] for name in TWICE} | {f"{name}_2": second[name] for name in TWICE}, None


TWICE = ("objective", "d_position", "d_harmonics")

OBJECTIVE = Operation(
    name="objective",
    equation="6",
    text="moving scene, render, full loss, every gradient",
    function="endotsr.training.fitting.objective.image_loss",
    forward=_objective,
    reverse=_objective_reverse,
    extra=_images_and_terms,
    trace=_objective_trace,
    variants=(Variant("objective", _objective_inputs, CHECKED, _frame, _objective_blocks),),
    is_loss=True,
)

OPERATIONS = [
    Operation(
        name="scene",
        equation="2",
        text="raw parameters at time t, every component applied",
        function="endotsr.training.fitting.model.scene_at",
        forward=_scene,
    ),
    OBJECTIVE,
    Operation(
        name="determinism",
        equation="6",
        text="the objective computed twice",
        function="endotsr.training.fitting.objective.image_loss",
        forward=_twice,
    ),
]
