"""Equation (7): the weight of the Laplacian loss that makes its gradient a given fraction of the photometric one.

In: for every calibration view, the RMS over all pixels and channels of two gradients with respect to the unclamped
render: of the whole photometric term (g_rgb) and of L_lap (g_lap). Out: lambda_lap = r / median_views(g_lap / g_rgb).
The trainer renders the views; this module does not depend on it.

The gradient of a mean absolute value depends on the signs of the residuals, not on their size. For (B6), the RMS
depends on the number of nonzero residuals; for (5), on the sign pattern of the bands.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.errors import CalibrationError


class ViewRms(NamedTuple):
    """Gradient magnitudes of one calibration view."""

    name: str  # frame name, for the table
    photometric: float  # g_rgb, RMS of d photometric / d render
    laplacian: float  # g_lap, RMS of d L_lap / d render


class Calibration(NamedTuple):
    """The calibrated weight and the ratios it is computed from."""

    lambda_lap: float
    ratios: NDArray[np.float64]  # (valid views,)  g_lap / g_rgb, in the order of the views
    table: str  # one line per view: name, g_rgb, g_lap, ratio or why it was dropped


def rms(gradient: NDArray[np.floating]) -> float:
    """Root mean square over all entries, summed in float64; 0 for an empty array."""
    flat = np.asarray(gradient, np.float64).reshape(-1)
    return math.sqrt(float(np.mean(flat * flat))) if flat.size else 0.0


def calibration_views(n_train: int, count: int) -> NDArray[np.int64]:
    """Positions, within the training frames, of the views to calibrate on: round(linspace(0, n_train - 1, count)).

    n_train  number of training frames, >= 0; if fewer than `count`, all of them are returned
    returns  ascending, without repeats
    """
    if n_train <= 0 or count <= 0:
        return np.zeros(0, np.int64)
    return np.unique(np.round(np.linspace(0, n_train - 1, count)).astype(np.int64))


def _verdict(view: ViewRms) -> str:
    """The reason to drop a view, or an empty string."""
    if not (math.isfinite(view.photometric) and math.isfinite(view.laplacian)):
        return "gradient not finite"
    if view.photometric <= 0:
        return "no photometric gradient"
    if view.laplacian < 0:
        return "negative RMS"
    if not math.isfinite(view.laplacian / view.photometric):
        return "ratio overflows"
    return ""


def calibrate(views: Iterable[ViewRms | tuple[str, float, float]], gradient_ratio: float) -> Calibration:
    """Equation (7): lambda_lap = r / median_v(g_lap,v / g_rgb,v).

    views           name, g_rgb and g_lap (loss per display unit) of each view
    gradient_ratio  r > 0, the desired ratio of the Laplacian gradient to the photometric one
    returns         lambda_lap (linear in r), the ratios of the valid views, a printable table
    Edges:          a view with g_rgb = 0, or with a non-finite gradient or ratio, is dropped. The median of an even
                    number of ratios is the mean of the middle two.
    Raises:         CalibrationError with the table if no view is valid, or the median is 0 or so small that lambda_lap
                    overflows; ValueError unless r is finite and > 0.
    Oracle:         `endotsr.definition.calibration`
    """
    if not (math.isfinite(gradient_ratio) and gradient_ratio > 0):
        raise ValueError(f"gradient ratio {gradient_ratio}; use a finite number > 0")
    ratios = []
    lines = [f"{'view':<24} {'g_rgb':>12} {'g_lap':>12}  g_lap/g_rgb"]
    for view in (ViewRms(*v) for v in views):
        dropped = _verdict(view)
        ratio = "" if dropped else f"{view.laplacian / view.photometric:.6g}"
        lines.append(f"{view.name:<24} {view.photometric:>12.5g} {view.laplacian:>12.5g}  {ratio or dropped}")
        if not dropped:
            ratios.append(view.laplacian / view.photometric)
    table = "\n".join(lines)
    if not ratios:
        raise CalibrationError(f"calibration: none of the {len(lines) - 1} views is valid\n{table}")
    median = float(np.median(ratios))
    weight = gradient_ratio / median if median > 0 else math.inf
    if not math.isfinite(weight):
        raise CalibrationError(f"calibration: the median of g_lap/g_rgb is {median:.3g}\n{table}")
    return Calibration(weight, np.array(ratios, np.float64), table)
