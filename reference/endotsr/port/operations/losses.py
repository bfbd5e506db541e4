"""Operations of the losses on images. Gradient checks hold the observed frame, its mask and the prior fixed."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.method.losses import depth, masked_ssim
from endotsr.method.losses.depth import depth_target
from endotsr.method.losses.masked_l1 import MaskedL1Saved, masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.smoothness import SmoothnessSaved, smoothness_forward, smoothness_reverse
from endotsr.port.operations.operation import Found, Inputs, Operation, PlainPair, Settings, Variant

Random = np.random.Generator

CHANNELS, HEIGHT, WIDTH = 3, 9, 14
FACTOR = 3.0  # total variation against squared steps: both must contribute to the gradient
PEAK = (5, 3)  # the pixel of the largest rendered depth


def _mask() -> NDArray[np.bool_]:
    """An instrument that enters from the right, and one isolated excluded pixel."""
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[2:5, 8:] = False
    mask[7, 2] = False
    return mask


def _observed() -> NDArray[np.float64]:
    return np.random.default_rng(61).uniform(0.2, 0.8, (CHANNELS, HEIGHT, WIDTH))


def _frame(dtype: np.dtype) -> dict[str, NDArray]:
    return {"observed": _observed().astype(dtype), "mask": _mask()}


# ---- masked L1 ----


def _l1_trace(inputs: Inputs, settings: Settings, saved: MaskedL1Saved) -> dict[str, NDArray]:
    difference = np.where(inputs["mask"], inputs["rendered"] - inputs["observed"], 0)
    return {"sign": np.sign(difference).astype(int)}


def _l1_inputs(rng: Random) -> dict[str, NDArray]:
    """Differences of 0.1 to 0.3 in both directions: far from the kink at equality."""
    shape = (CHANNELS, HEIGHT, WIDTH)
    difference = rng.uniform(0.1, 0.3, shape) * rng.choice([-1.0, 1.0], shape)
    return {"rendered": _observed() + difference}


# ---- masked SSIM ----


def _ssim(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    target = module.ssim_target(inputs["observed"], inputs["mask"])
    ssim, saved = module.masked_ssim_forward(inputs["rendered"], target)
    return {"ssim": ssim}, saved


def _ssim_reverse(module: Any, cotangents: Inputs, saved: Any) -> Found:
    return {"d_rendered": module.masked_ssim_reverse(float(cotangents["ssim"]), saved)}


def _ssim_inputs(rng: Random) -> dict[str, NDArray]:
    return {"rendered": _observed() + 0.15 * rng.standard_normal((CHANNELS, HEIGHT, WIDTH))}


# ---- normalised depth ----


def _depth(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, tuple[Any, Any]]:
    target = module.depth_target(inputs["prior_depth"], inputs["mask"])
    loss, saved = module.normalised_depth_forward(inputs["rendered_depth"], target)
    return {"loss": loss}, (saved, target)


def _depth_reverse(module: Any, cotangents: Inputs, saved: tuple[Any, Any]) -> Found:
    return {"d_rendered_depth": module.normalised_depth_reverse(float(cotangents["loss"]), saved[0])}


def _depth_trace(inputs: Inputs, settings: Settings, saved: tuple[Any, Any]) -> dict[str, NDArray]:
    rendered = inputs["rendered_depth"]
    residual = np.where(saved[1].valid, rendered / rendered.max() - saved[1].normalised, 0)
    return {"peak": np.array(int(rendered.argmax())), "sign": np.sign(residual).astype(int)}


def _priors(dtype: np.dtype) -> dict[str, NDArray]:
    """Priors of 40 to 60 with three holes; the largest prior and the largest render are at different pixels."""
    prior = np.random.default_rng(67).uniform(40.0, 55.0, (HEIGHT, WIDTH))
    prior[0, 0], prior[3, 1], prior[6, 6] = 0.0, -1.0, np.nan
    prior[8, 13], prior[PEAK] = 60.0, 48.0
    return {"prior_depth": prior.astype(dtype), "mask": _mask()}


def _depth_inputs(rng: Random) -> dict[str, NDArray]:
    """Residuals of 0.04 to 0.1 in both directions, and a largest depth well above the second largest."""
    residual = rng.uniform(0.04, 0.1, (HEIGHT, WIDTH)) * rng.choice([-1.0, 1.0], (HEIGHT, WIDTH))
    target = depth_target(*_priors(np.dtype(np.float64)).values())
    fraction = np.minimum(target.normalised, 0.85) + residual
    fraction[PEAK] = 1.0
    return {"rendered_depth": fraction * rng.uniform(60.0, 80.0)}


# ---- smoothness ----


def _smoothness_trace(inputs: Inputs, settings: Settings, saved: SmoothnessSaved) -> dict[str, NDArray]:
    outside = [np.where(inputs["mask"], 0, inputs[name]) for name in ("rendered_depth", "rendered")]
    steps = [np.diff(value, axis=axis) for value in outside for axis in (-1, -2)]
    return {f"sign {k}": np.sign(step).astype(int) for k, step in enumerate(steps)}


def _edges(dtype: np.dtype) -> dict[str, NDArray]:
    edges = np.zeros((HEIGHT, WIDTH), bool)
    edges[1:8, 4] = True
    return {"mask": _mask(), "edges": edges}


def _smoothness_inputs(rng: Random) -> dict[str, NDArray]:
    """A checkerboard of 0.4 and 0.8 with noise of 0.1: no equal neighbours, and no value near the 0 of tissue."""
    parity = np.add.outer(np.arange(HEIGHT), np.arange(WIDTH)) % 2
    board = 0.4 + 0.4 * parity
    return {
        "rendered_depth": 3.0 * (board + rng.uniform(0.0, 0.1, (HEIGHT, WIDTH))),
        "rendered": board + rng.uniform(0.0, 0.1, (CHANNELS, HEIGHT, WIDTH)),
    }


OPERATIONS = [
    PlainPair(masked_l1_forward, masked_l1_reverse, "rendered observed mask", "loss", "d_rendered").operation(
        "masked_l1",
        "B6",
        "masked L1",
        trace=_l1_trace,
        variants=(Variant("masked_l1", _l1_inputs, fixed=_frame),),
    ),
    Operation(
        name="masked_ssim",
        equation="B7",
        text="masked SSIM",
        function="endotsr.method.losses.masked_ssim.masked_ssim_forward",
        forward=partial(_ssim, masked_ssim),
        reverse=partial(_ssim_reverse, masked_ssim),
        variants=(Variant("masked_ssim", _ssim_inputs, fixed=_frame),),
    ),
    Operation(
        name="normalised_depth",
        equation="B8",
        text="normalised depth",
        function="endotsr.method.losses.depth.normalised_depth_forward",
        forward=partial(_depth, depth),
        reverse=partial(_depth_reverse, depth),
        trace=_depth_trace,
        variants=(Variant("normalised_depth", _depth_inputs, fixed=_priors),),
    ),
    PlainPair(
        smoothness_forward, smoothness_reverse, "rendered_depth rendered mask edges total_variation_factor", "loss"
    ).operation(
        "smoothness",
        "B9",
        "smoothness with given edges",
        trace=_smoothness_trace,
        variants=(Variant("smoothness", _smoothness_inputs, {"total_variation_factor": FACTOR}, _edges),),
    ),
]
