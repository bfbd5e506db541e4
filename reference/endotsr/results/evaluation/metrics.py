"""PSNR (M1) and SSIM (M2) of a render against a frame, over the full image and over tissue.

In: planar images (3, H, W) in display units and the tissue mask. Out: plain floats. "Full" sets excluded pixels to 0 in
both images and averages over all pixels, as published tables do. "Tissue" averages over tissue pixels only; its PSNR is
never above the full one. All arithmetic is float64. Values at excluded pixels, including NaN, have no effect.
"""

import math
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.losses.masked_ssim import masked_ssim_forward, ssim_target
from endotsr.method.losses.rows import check_image

LEVELS = 255  # of an 8-bit image


def psnr(render: FloatArray, truth: FloatArray, mask: BoolArray) -> float:
    """PSNR (M1) in dB, peak 1: mean squared error over all C H W values, with excluded pixels 0 in both images.

    render, truth  (C, H, W)  display units, not clipped
    mask           (H, W)     bool, True = tissue
    Edges:   images equal on tissue: inf; no tissue: nan. `mean_metrics` excludes both.
    Raises:  ValueError for different shapes or a mask that is not boolean.
    Oracle:  skimage.metrics.peak_signal_noise_ratio of the zeroed images.
    """
    return _both_psnr(render, truth, mask)[0]


def psnr_tissue(render: FloatArray, truth: FloatArray, mask: BoolArray) -> float:
    """PSNR (M1) in dB over tissue pixels only: `psnr` + 10 log10(tissue fraction). Edges as `psnr`."""
    return _both_psnr(render, truth, mask)[1]


def ssim_full(render: FloatArray, truth: FloatArray, mask: BoolArray) -> float:
    """SSIM (M2) of the images with excluded pixels 0: mean of the SSIM map over all pixels.

    11 x 11 Gaussian window, sigma 1.5, zero padding, C1 = 0.01^2, C2 = 0.03^2; other variants give other values.
    Edges:   no tissue: nan. Raises as `psnr`. Oracle: `endotsr.definition.metrics`.
    """
    if not mask.any():
        return math.nan
    everywhere = np.ones(mask.shape, bool)
    zeroed = [np.where(mask, _wide("image", image, mask), 0.0) for image in (render, truth)]
    return masked_ssim_forward(zeroed[0], ssim_target(zeroed[1], everywhere))[0]


def ssim_tissue(render: FloatArray, truth: FloatArray, mask: BoolArray) -> float:
    """SSIM (M2): the map of `ssim_full` averaged over tissue pixels. Edges as `ssim_full`."""
    if not mask.any():
        return math.nan
    return masked_ssim_forward(_wide("render", render, mask), ssim_target(_wide("truth", truth, mask), mask))[0]


def round_8bit(image: FloatArray) -> NDArray[np.float64]:
    """The image as stored in an 8-bit file: clipped to [0, 1], rounded half up to k / 255. NaN stays NaN."""
    return np.floor(np.clip(np.asarray(image, np.float64), 0.0, 1.0) * LEVELS + 0.5) / LEVELS


def image_metrics(render: FloatArray, truth: FloatArray, mask: BoolArray) -> dict[str, float]:
    """All metrics of one image.

    render  (3, H, W)  display units; clipped to [0, 1] first, like on a display
    truth   (3, H, W)  display units [0, 1]
    returns `psnr_full`, `psnr_tissue`, `ssim_full`, `ssim_tissue` of the float images, and the same four with suffix
            `_8bit` of the images rounded to 8 bits; inf and nan as in each function
    """
    pictures = {"": (np.clip(render, 0.0, 1.0), truth), "_8bit": (round_8bit(render), round_8bit(truth))}
    found = {}
    for ending, (seen, wanted) in pictures.items():
        found["psnr_full" + ending], found["psnr_tissue" + ending] = _both_psnr(seen, wanted, mask)
        found["ssim_full" + ending] = ssim_full(seen, wanted, mask)
        found["ssim_tissue" + ending] = ssim_tissue(seen, wanted, mask)
    return found


def mean_metrics(rows: Iterable[Mapping[str, float | None]]) -> dict[str, float | int | None]:
    """Means over images of each metric; PSNR is averaged in dB.

    rows     dictionaries of `image_metrics`, possibly with more metrics; None = not computed
    returns  for each metric its mean over the images with a finite value (None without any), `<metric>_excluded`: the
             number of other images, `images`: the number of all images
    """
    rows = list(rows)
    result: dict[str, float | int | None] = {"images": len(rows)}
    for key in dict.fromkeys(key for row in rows for key in row):
        values = [value for row in rows if (value := row.get(key)) is not None and math.isfinite(value)]
        result[key] = math.fsum(values) / len(values) if values else None
        result[f"{key}_excluded"] = len(rows) - len(values)
    return result


def _both_psnr(render: FloatArray, truth: FloatArray, mask: BoolArray) -> tuple[float, float]:
    """`psnr` and `psnr_tissue`, from the squared differences on tissue."""
    difference = _wide("render", render, mask)[:, mask] - _wide("truth", truth, mask)[:, mask]
    if not difference.size:
        return math.nan, math.nan
    squared = float(np.sum(difference * difference))
    return _decibel(squared / render.size), _decibel(squared / difference.size)


def _wide(name: str, image: FloatArray, mask: BoolArray) -> NDArray[np.float64]:
    return check_image(name, np.asarray(image), mask).astype(np.float64)


def _decibel(mean_squared_error: float) -> float:
    """-10 log10; inf for equal images, nan stays nan."""
    return math.inf if mean_squared_error == 0 else -10.0 * math.log10(mean_squared_error)
