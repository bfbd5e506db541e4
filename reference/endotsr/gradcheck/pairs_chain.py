"""The whole chain as one pair: raw parameters of every component -> moving scene -> render -> objective (6)."""

import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config, LossConfig, ModelConfig
from endotsr.equations.deformation import deformation_reverse
from endotsr.equations.laplacian import laplacian_levels
from endotsr.equations.matern import matern_penalty_forward, matern_penalty_reverse
from endotsr.fitting.model import Spectral, scene_at, scene_reverse, spectral_from
from endotsr.fitting.objective import LossWeights, Targets, frame_targets, image_loss
from endotsr.gradcheck.pairs_splatting import COUNT, HEIGHT, WIDE, WIDTH, _as_masks, _camera, _render_trace, _scene
from endotsr.gradcheck.registry import Arrays, Pair
from endotsr.opencv import canny_edges
from endotsr.scene.gaussians import Gaussians
from endotsr.sequences.sequence import Frame
from endotsr.splatting.render import render_forward, render_reverse

TIME = 0.37
BASES, FREQUENCIES = 3, 2
CONFIG = Config(
    model=ModelConfig(bases=BASES, frequencies=FREQUENCIES, initial_width=0.2),
    loss=LossConfig(ssim_weight=0.3, lambda_lap=0.8, total_variation_factor=2.0),
)
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


def _spectral() -> Spectral:
    return spectral_from(CONFIG.model, np.arange(12) / 12)


def _run(inputs: Arrays):
    gaussians = Gaussians(*(inputs[name] for name in Gaussians._fields))
    scene, scene_saved = scene_at(gaussians, _spectral(), CONFIG.model, TIME)
    rendered, saved = render_forward(scene, _camera(), WIDE, compositor="blocks")
    targets = frame_targets(_frame(scene.position.dtype), CONFIG)
    loss = image_loss(rendered, targets, WEIGHTS, CONFIG.loss)
    assert gaussians.motion_coefficients is not None
    penalty, penalty_saved = matern_penalty_forward(gaussians.motion_coefficients, _spectral().rho)
    return rendered, targets, loss, penalty, saved, scene_saved, penalty_saved


def _forward(inputs: Arrays) -> dict[str, NDArray]:
    _, _, loss, penalty, *_ = _run(inputs)
    return {"objective": np.array(loss.loss + CONFIG.loss.lambda_msp * penalty)}


def _reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    up = float(cotangents["objective"])
    _, _, loss, _, saved, scene_saved, penalty_saved = _run(inputs)
    dtype = loss.d_colour.dtype.type
    grads = render_reverse(loss.d_colour * dtype(up), loss.d_depth * dtype(up), None, saved)
    back = scene_reverse(grads, scene_saved)
    assert scene_saved.deformation is not None and back.offsets is not None
    fdm = deformation_reverse(back.offsets, scene_saved.deformation)
    out = dict(back.by_field)
    out["motion_coefficients"] = out["motion_coefficients"] + matern_penalty_reverse(
        up * CONFIG.loss.lambda_msp, penalty_saved
    )
    return out | {"fdm_weight": fdm.weight, "fdm_centre": fdm.centre, "fdm_width": fdm.width}


def _trace(inputs: Arrays) -> dict[str, NDArray]:
    """Signs of every absolute value, the depth maximum and the edges, beside the decisions of the render."""
    rendered, targets, _, _, saved, *_ = _run(inputs)
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
