"""The whole chain as one pair: raw parameters -> moving scene -> render -> exposure -> objective (6).

Both directions are `view_gradients`: what is checked here is what training computes.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config, LossConfig, ModelConfig
from endotsr.equations.laplacian import laplacian_levels
from endotsr.fitting.model import exposed, scene_at, spectral_from
from endotsr.fitting.objective import LossWeights, Targets, frame_targets
from endotsr.fitting.view import ViewGradients, view_gradients
from endotsr.gradcheck.pairs_splatting import COUNT, HEIGHT, WIDE, WIDTH, _as_masks, _camera, _render_trace, _scene
from endotsr.gradcheck.registry import Arrays, Pair
from endotsr.opencv import canny_edges
from endotsr.scene.gaussians import Gaussians
from endotsr.scene.parameters import Exposure
from endotsr.sequences.sequence import Frame
from endotsr.splatting.render import render_forward

TIME = 0.37
BASES, FREQUENCIES = 3, 2
CONFIG = Config(
    model=ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.2),
    loss=LossConfig(ssim_weight=0.3, lambda_lap=0.8, total_variation_factor=2.0),
)
SPECTRAL = spectral_from(CONFIG.model, np.arange(12) / 12)
WEIGHTS = LossWeights(ssim=0.3, depth=1.0, smoothness=0.05, laplacian=0.8)


def _inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Every component off zero, so that no gradient vanishes for want of a coefficient."""
    scene = _scene(rng)
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


def _frame(dtype: np.dtype) -> Frame:
    """A fixed observed frame with an excluded corner and two pixels without depth."""
    rng = np.random.default_rng(5)
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[:3, :4] = False
    depth = rng.uniform(2.0, 5.0, (HEIGHT, WIDTH)).astype(dtype)
    depth[8, 8] = depth[9, 3] = 0
    image = rng.uniform(0.1, 0.9, (3, HEIGHT, WIDTH)).astype(dtype)
    return Frame(image=image, mask=mask, depth=depth, time=TIME, camera=_camera())


def _view(inputs: Arrays) -> ViewGradients:
    gaussians = Gaussians(*(inputs[name] for name in Gaussians._fields))
    targets = frame_targets(_frame(gaussians.position.dtype), CONFIG)
    return view_gradients(
        gaussians, SPECTRAL, targets, WEIGHTS, CONFIG, _camera(), TIME,
        exposure=_exposure(inputs), raster=WIDE, compositor="blocks",
    )  # fmt: skip


def _exposure(inputs: Arrays) -> Exposure:
    return Exposure(inputs["exposure_log_gain"], inputs["exposure_bias"])


def _forward(inputs: Arrays) -> dict[str, NDArray]:
    return {"objective": np.array(_view(inputs).loss)}


def _reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    view = _view(inputs)
    assert view.exposure is not None
    gradients = view.gradients | {f"exposure_{name}": g for name, g in view.exposure._asdict().items()}
    return {name: g * g.dtype.type(cotangents["objective"]) for name, g in gradients.items()}


def _trace(inputs: Arrays) -> dict[str, NDArray]:
    """Signs of every absolute value, the depth maximum and the edges, beside the decisions of the render."""
    gaussians = Gaussians(*(inputs[name] for name in Gaussians._fields))
    scene, _ = scene_at(gaussians, SPECTRAL, CONFIG.model, TIME)
    rendered, saved = render_forward(scene, _camera(), WIDE, compositor="blocks")
    rendered, _ = exposed(rendered, _exposure(inputs))
    targets = frame_targets(_frame(scene.position.dtype), CONFIG)
    difference = np.where(targets.mask, rendered.colour - targets.image, 0)
    out = _render_trace(saved) | {
        "l1": np.sign(difference).astype(int),
        "edges": canny_edges(rendered.depth).astype(int),
    }
    out |= {f"band {j}": np.sign(band).astype(int) for j, band in enumerate(laplacian_levels(difference).bands)}
    return out | _depth_trace(rendered.depth, targets) | _variation_trace(rendered, targets)


def _depth_trace(depth: NDArray, targets: Targets) -> dict[str, NDArray]:
    assert targets.depth is not None
    residual = np.where(targets.depth.valid, depth / depth.max() - targets.depth.normalised, 0)
    return {"peak": np.array(depth.argmax()), "depth": np.sign(residual).astype(int)}


def _variation_trace(rendered, targets: Targets) -> dict[str, NDArray]:
    outside = np.where(targets.mask, 0, np.concatenate([rendered.colour, rendered.depth[None]]))
    return {f"steps {axis}": np.sign(np.diff(outside, axis=axis)).astype(int) for axis in (1, 2)}


def _blocks(inputs: Arrays) -> dict[str, tuple[str, object]]:
    channels = {"position": slice(0, 3), "quaternion": slice(3, 7), "log-scale": slice(7, 10)}
    out: dict[str, tuple[str, object]] = {
        f"fdm {part} {name}": (f"fdm_{part}", index)
        for part in ("weight", "centre", "width")
        for name, index in channels.items()
    }
    for name in ("appearance_coefficients", "motion_coefficients"):
        for f in range(FREQUENCIES):
            out[f"{name} frequency {f}"] = (name, (slice(None), [f, f + FREQUENCIES]))
    return out | {key: (key, ...) for key in inputs if not key.startswith("fdm") and not key.endswith("coefficients")}


PAIRS: list[Pair] = [
    Pair(
        "objective",
        "6",
        "endotsr.fitting.objective.image_loss",
        _inputs,
        _forward,
        _reverse,
        _as_masks(_blocks),
        _trace,
    )
]
