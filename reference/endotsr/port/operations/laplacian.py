"""Operations of the Laplacian loss (5) and the calibration of its weight (7)."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import CalibrationError
from endotsr.method.equations import calibration, laplacian
from endotsr.method.equations.laplacian import SupportMasks, laplacian_levels, support_masks
from endotsr.method.equations.pyramid import Upsampling
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings, Variant, split_blocks

LEVELS = 3
IMAGE_SHAPE = (3, 19, 22)  # odd and even; sizes 19x22, 10x11, 5x6, 3x3


# ---- equation (5) ----


def _laplacian(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, tuple[Any, Any]]:
    rule = settings["upsampling"]
    masks = module.support_masks(inputs["mask"], settings["levels"], rule)
    loss, saved = module.laplacian_loss_forward(inputs["rendered"], inputs["observed"], masks, rule)
    return {"loss": loss}, (saved, masks)


def _laplacian_reverse(module: Any, cotangents: Inputs, saved: tuple[Any, Any]) -> Found:
    return {"d_rendered": module.laplacian_loss_reverse(float(cotangents["loss"]), saved[0])}


def _bands(module: Any, inputs: Inputs, settings: Settings, saved: tuple[Any, Any]) -> Found:
    """Bands of the observed image and their valid pixels."""
    pyramid = module.laplacian_levels(inputs["observed"], settings["levels"], settings["upsampling"])
    bands = {f"band_{j}": band for j, band in enumerate(pyramid.bands, start=1)}
    return bands | {f"valid_{j}": valid for j, valid in enumerate(saved[1].bands, start=1)}


def _laplacian_trace(inputs: Inputs, settings: Settings, saved: tuple[Any, Any]):
    return {f"signs_{j}": sign for j, sign in enumerate(saved[0].signs, start=1)}


def observed_image() -> NDArray[np.float64]:
    """The fixed observed image of the gradient checks, from a closed formula."""
    c, y, x = np.meshgrid(*(np.arange(n) for n in IMAGE_SHAPE), indexing="ij")
    return 0.5 + 0.3 * np.sin(0.9 * x + 0.4 * c) * np.cos(0.7 * y)


def tissue_mask() -> NDArray[np.bool_]:
    """Its mask: an instrument in the lower right corner, small enough for valid pixels at every level."""
    _, height, width = IMAGE_SHAPE
    y, x = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    return (y < height - 2) | (x < width - 3)


def _kink_distance(rendered: NDArray, masks: SupportMasks) -> float:
    bands = laplacian_levels(rendered - observed_image(), len(masks.bands), masks.upsampling).bands
    return min(float(np.abs(band[:, valid]).min()) for band, valid in zip(bands, masks.bands))


def _variant(rule: Upsampling) -> Variant:
    def inputs(rng: np.random.Generator) -> dict[str, NDArray]:
        """Of 16 draws, the one with valid band differences furthest from the kink of |.|."""
        masks = support_masks(tissue_mask(), LEVELS, rule)
        draws = [observed_image() + rng.normal(0.0, 0.3, IMAGE_SHAPE) for _ in range(16)]
        return {"rendered": max(draws, key=lambda rendered: _kink_distance(rendered, masks))}

    return Variant(
        f"laplacian_loss_{rule}",
        inputs,
        settings={"upsampling": rule, "levels": LEVELS},
        fixed=lambda dtype: {"observed": observed_image(), "mask": tissue_mask()},
        blocks=split_blocks({"rendered": {f"rendered[{c}]": np.s_[c : c + 1] for c in range(IMAGE_SHAPE[0])}}),
        covers=lambda settings: settings["upsampling"] == rule,
    )


# ---- equation (7) ----


def _calibration(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, None]:
    """One row per view; the inputs are gradient images, so the case includes the RMS."""
    g_rgb = [module.rms(view) for view in inputs["d_photometric"]]
    g_lap = [module.rms(view) for view in inputs["d_laplacian"]]
    views = [(str(k), a, b) for k, (a, b) in enumerate(zip(g_rgb, g_lap))]
    try:
        weight, refused = module.calibrate(views, settings["gradient_ratio"]).lambda_lap, False
    except (CalibrationError, ValueError):  # the definition raises ValueError
        weight, refused = 0.0, True
    return {
        "g_rgb": np.array(g_rgb),
        "g_lap": np.array(g_lap),
        "lambda_lap": weight,
        "refused": np.array(refused),
    }, None


OPERATIONS = [
    Operation(
        name="laplacian",
        equation="5",
        text="pyramid of the observed image, valid pixels, loss",
        function="endotsr.method.equations.laplacian.laplacian_loss_forward",
        forward=partial(_laplacian, laplacian),
        reverse=partial(_laplacian_reverse, laplacian),
        extra=partial(_bands, laplacian),
        trace=_laplacian_trace,
        variants=(_variant("co_sited"), _variant("half_pixel")),
    ),
    Operation(
        name="calibration",
        equation="7",
        text="Laplacian weight from gradient images",
        function="endotsr.method.equations.calibration.calibrate",
        forward=partial(_calibration, calibration),
    ),
]
