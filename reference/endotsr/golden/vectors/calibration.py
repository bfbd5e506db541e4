"""Family `calibration`: equation (7), the weight of the Laplacian loss from gradient images.

The gradient images of some views come in, photometric and Laplacian, so that their RMS is part of the case. The cases
have an odd and an even number of views, a view without photometric gradient, and no valid view at all.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Seeds, Spec, changed
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort

OPERATIONS = ("calibration",)


def cases() -> list[Spec]:
    """Five views or four, with and without a valid one."""
    out = []
    for case, title, flags in (
        ("odd", "Median over the views of g_lap / g_rgb", ("calibration_mean", "calibration_inverted",
                                                           "calibration_over_tissue")),
        ("even", "An even number of views: the mean of the middle two", ("calibration_lower_median",)),
        ("dead_view", "A view without photometric gradient is dropped", ("calibration_keeps_dead_view",)),
        ("all_dead", "No valid view: refused, not infinite", ("calibration_of_nothing",)),
    ):  # fmt: skip
        seeds = Seeds("calibration", case)
        views = 4 if case == "even" else 5
        steep = np.array([1.0, 0.25, 3.0, 0.5, 2.0])[:views, None, None, None]
        laplacian = seeds.uniform("d_laplacian", -1.0, 1.0, views, 3, 3, 4, unit="loss per display unit")
        laplacian = changed(laplacian, ..., laplacian.array * steep, "view v times (1, 1/4, 3, 1/2, 2)[v]")
        rgb = seeds.uniform("d_photometric", -1.0, 1.0, views, 3, 3, 4, unit="loss per display unit")
        rgb = changed(rgb, (slice(None), slice(None), slice(2, None)), 0.0, "rows from 2 on are 0 (excluded)")
        if case == "dead_view":
            rgb = changed(rgb, 1, 0.0, "view 1 is 0")
        if case == "all_dead":
            rgb = changed(rgb, ..., 0.0, "all 0")
        inputs = {"d_photometric": rgb, "d_laplacian": laplacian}
        own = ("lambda_lap",) if case == "all_dead" else ()
        settings = {"gradient_ratio": 0.25}
        out.append(Spec("calibration", case, "calibration", title, flags, settings, inputs, own=own))
    return out


# ---- mistakes ----


def _weight(middle: Callable[[NDArray, NDArray], float]) -> dict[str, Wrong]:
    """Another middle than the median over the valid views of g_lap / g_rgb."""

    def wrong(request: Request) -> dict[str, Any] | None:
        rgb, laplacian = request.right["g_rgb"], request.right["g_lap"]
        if not (rgb > 0).any():
            return None
        return {"lambda_lap": request.settings["gradient_ratio"] / middle(rgb, laplacian)}

    return {"calibration": wrong}


def _lower_median(rgb: NDArray, laplacian: NDArray) -> float:
    ratios = np.sort(_live(rgb, laplacian))
    return ratios[(ratios.size - 1) // 2]


def _with_dead_views(rgb: NDArray, laplacian: NDArray) -> float:
    return float(np.median(np.where(rgb > 0, laplacian / np.where(rgb > 0, rgb, 1), np.inf)))


def _live(rgb: NDArray, laplacian: NDArray) -> NDArray:
    """Ratios of the views that have a photometric gradient."""
    return (laplacian / rgb)[rgb > 0]


def _over_tissue(request: Request) -> dict[str, Any]:
    """RMS over the pixels that have a gradient."""
    rgb, laplacian = request.inputs["d_photometric"], request.inputs["d_laplacian"]
    g = np.array([np.sqrt((v[v != 0] ** 2).mean()) if v.any() else 0.0 for v in rgb])
    h = np.sqrt((laplacian**2).mean(axis=(1, 2, 3)))
    live = g > 0
    if not live.any():
        return {}
    return {"g_rgb": g, "lambda_lap": request.settings["gradient_ratio"] / np.median(h[live] / g[live])}


WRONG_PORTS = [
    WrongPort("calibration_mean", "Mean over the views", "mean; right: median",
              _weight(lambda rgb, laplacian: _live(rgb, laplacian).mean())),
    WrongPort("calibration_lower_median", "Lower of the middle two", "no interpolation; right: their mean",
              _weight(_lower_median)),
    WrongPort("calibration_inverted", "Ratio of the gradients inverted", "g_rgb / g_lap; right: g_lap / g_rgb",
              _weight(lambda rgb, laplacian: float(np.median(1 / _live(rgb, laplacian))))),
    WrongPort("calibration_over_tissue", "RMS over tissue pixels", "over pixels with a gradient; right: over all",
              {"calibration": _over_tissue}),
    WrongPort("calibration_keeps_dead_view", "View without photometric gradient kept",
              "an infinite ratio moves the median; right: dropped", _weight(_with_dead_views)),
    WrongPort("calibration_of_nothing", "Calibration without a valid view answered", "not a number; right: refused",
              {"calibration": lambda r: {"refused": np.array(False), "lambda_lap": np.nan}
               if r.right["refused"] else None}),
]  # fmt: skip
