"""Pairs of the base losses. The observed frame, its mask and the depth prior are fixed inside each pair."""

import numpy as np
from numpy.typing import NDArray

from endotsr.gradcheck.registry import Arrays, Pair
from endotsr.losses.depth import DepthTarget, depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.losses.masked_ssim import SsimTarget, masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.losses.smoothness import smoothness_forward, smoothness_reverse

CHANNELS, HEIGHT, WIDTH = 3, 9, 14
FACTOR = 3.0  # total variation against squared steps: both parts of the gradient must show


def _mask() -> NDArray[np.bool_]:
    """A tool that reaches in from the right and one excluded pixel alone."""
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[2:5, 8:] = False
    mask[7, 2] = False
    return mask


def _observed(dtype: np.dtype) -> NDArray[np.floating]:
    return np.random.default_rng(61).uniform(0.2, 0.8, (CHANNELS, HEIGHT, WIDTH)).astype(dtype)


def _scalar(loss: float) -> NDArray:
    return np.array(loss, np.float64)


# --- masked L1 ---


def _l1_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Differences of 0.1 to 0.3 in both directions: far from the kink at equality."""
    shape = (CHANNELS, HEIGHT, WIDTH)
    difference = rng.uniform(0.1, 0.3, shape) * rng.choice([-1.0, 1.0], shape)
    return {"rendered": _observed(np.dtype(np.float64)) + difference}


def _l1_forward(inputs: Arrays) -> dict[str, NDArray]:
    rendered = inputs["rendered"]
    return {"loss": _scalar(masked_l1_forward(rendered, _observed(rendered.dtype), _mask())[0])}


def _l1_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    rendered = inputs["rendered"]
    _, saved = masked_l1_forward(rendered, _observed(rendered.dtype), _mask())
    return {"rendered": masked_l1_reverse(float(cotangents["loss"]), saved)}


def _l1_trace(inputs: Arrays) -> dict[str, NDArray]:
    rendered = inputs["rendered"]
    return {"sign": np.sign(rendered - _observed(rendered.dtype)).astype(int)}


# --- masked SSIM ---


def _ssim_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    shape = (CHANNELS, HEIGHT, WIDTH)
    return {"rendered": _observed(np.dtype(np.float64)) + 0.15 * rng.standard_normal(shape)}


def _ssim_fixed(dtype: np.dtype) -> SsimTarget:
    return ssim_target(_observed(dtype), _mask())


def _ssim_forward(inputs: Arrays) -> dict[str, NDArray]:
    rendered = inputs["rendered"]
    return {"ssim": _scalar(masked_ssim_forward(rendered, _ssim_fixed(rendered.dtype))[0])}


def _ssim_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    rendered = inputs["rendered"]
    _, saved = masked_ssim_forward(rendered, _ssim_fixed(rendered.dtype))
    return {"rendered": masked_ssim_reverse(float(cotangents["ssim"]), saved)}


# --- normalised depth ---

PEAK = (5, 3)  # the pixel that holds the largest rendered depth


def _depth_fixed(dtype: np.dtype) -> DepthTarget:
    """Priors of 40 to 60 with three holes; the largest one is not where the render has its largest."""
    prior = np.random.default_rng(67).uniform(40.0, 55.0, (HEIGHT, WIDTH))
    prior[0, 0], prior[3, 1], prior[6, 6] = 0.0, -1.0, np.nan
    prior[8, 13], prior[PEAK] = 60.0, 48.0
    return depth_target(prior.astype(dtype), _mask())


def _depth_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """Residuals of 0.04 to 0.1 in both directions, and a largest depth well above the second largest."""
    residual = rng.uniform(0.04, 0.1, (HEIGHT, WIDTH)) * rng.choice([-1.0, 1.0], (HEIGHT, WIDTH))
    share = np.minimum(_depth_fixed(np.dtype(np.float64)).normalised, 0.85) + residual
    share[PEAK] = 1.0
    return {"rendered_depth": share * rng.uniform(60.0, 80.0)}


def _depth_forward(inputs: Arrays) -> dict[str, NDArray]:
    depth = inputs["rendered_depth"]
    return {"loss": _scalar(normalised_depth_forward(depth, _depth_fixed(depth.dtype))[0])}


def _depth_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    depth = inputs["rendered_depth"]
    _, saved = normalised_depth_forward(depth, _depth_fixed(depth.dtype))
    return {"rendered_depth": normalised_depth_reverse(float(cotangents["loss"]), saved)}


def _depth_trace(inputs: Arrays) -> dict[str, NDArray]:
    depth = inputs["rendered_depth"]
    residual = depth / depth.max() - _depth_fixed(depth.dtype).normalised
    return {"peak": np.array(int(depth.argmax())), "sign": np.sign(residual).astype(int)}


# --- smoothness ---


def _edges() -> NDArray[np.bool_]:
    edges = np.zeros((HEIGHT, WIDTH), bool)
    edges[1:8, 4] = True
    return edges


def _smoothness_inputs(rng: np.random.Generator) -> dict[str, NDArray]:
    """A checkerboard of 0.4 and 0.8 with noise of 0.1: no neighbours are equal, nothing is near the 0 of tissue."""
    parity = np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)) % 2
    board = 0.4 + 0.4 * parity
    return {
        "rendered_depth": 3.0 * (board + rng.uniform(0.0, 0.1, (HEIGHT, WIDTH))),
        "rendered": board + rng.uniform(0.0, 0.1, (CHANNELS, HEIGHT, WIDTH)),
    }


def _smoothness_forward(inputs: Arrays) -> dict[str, NDArray]:
    loss, _ = smoothness_forward(inputs["rendered_depth"], inputs["rendered"], _mask(), _edges(), FACTOR)
    return {"loss": _scalar(loss)}


def _smoothness_reverse(inputs: Arrays, cotangents: Arrays) -> dict[str, NDArray]:
    _, saved = smoothness_forward(inputs["rendered_depth"], inputs["rendered"], _mask(), _edges(), FACTOR)
    return smoothness_reverse(float(cotangents["loss"]), saved)._asdict()


def _smoothness_trace(inputs: Arrays) -> dict[str, NDArray]:
    outside = {name: np.where(_mask(), 0, value) for name, value in inputs.items()}
    steps = [np.diff(value, axis=axis) for value in outside.values() for axis in (-1, -2)]
    return {f"sign {k}": np.sign(step).astype(int) for k, step in enumerate(steps)}


PAIRS: list[Pair] = [
    Pair(
        name="masked_l1",
        equation="B6",
        function="endotsr.losses.masked_l1.masked_l1_forward",
        inputs=_l1_inputs,
        forward=_l1_forward,
        reverse=_l1_reverse,
        trace=_l1_trace,
    ),
    Pair(
        name="masked_ssim",
        equation="B7",
        function="endotsr.losses.masked_ssim.masked_ssim_forward",
        inputs=_ssim_inputs,
        forward=_ssim_forward,
        reverse=_ssim_reverse,
    ),
    Pair(
        name="normalised_depth",
        equation="B8",
        function="endotsr.losses.depth.normalised_depth_forward",
        inputs=_depth_inputs,
        forward=_depth_forward,
        reverse=_depth_reverse,
        trace=_depth_trace,
    ),
    Pair(
        name="smoothness",
        equation="B9",
        function="endotsr.losses.smoothness.smoothness_forward",
        inputs=_smoothness_inputs,
        forward=_smoothness_forward,
        reverse=_smoothness_reverse,
        trace=_smoothness_trace,
    ),
]
