"""Family `calibration`: equation (7), the weight of the Laplacian loss from gradient images.

The gradient images of some views come in, photometric and Laplacian, so that their RMS is part of the case. The cases
have an odd and an even number of views, a view without photometric gradient, and no valid view at all.
"""

import numpy as np

from makers.making import Seeds, Spec, changed
from makers.wrong import edit, port

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
        ("zero_ratio", "A view whose Laplacian gradient is 0 counts with the ratio 0", ()),
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
        if case == "zero_ratio":
            laplacian = changed(laplacian, 2, 0.0, "view 2 is 0")
        inputs = {"d_photometric": rgb, "d_laplacian": laplacian}
        own = ("lambda_lap",) if case == "all_dead" else ()
        settings = {"gradient_ratio": 0.25}
        out.append(Spec("calibration", case, "calibration", title, flags, settings, inputs, own=own))
    return out


# ---- mistakes ----

SOURCE = "equations.calibration"
RATIOS, MEDIAN = "ratios.append(view.laplacian / view.photometric)", "float(np.median(ratios))"
BOTH = "calibration training"

WRONG_PORTS = [
    port(
        "calibration_mean",
        "Mean over the views",
        "mean; right: median",
        BOTH,
        edit(SOURCE, MEDIAN, "float(np.mean(ratios))"),
    ),
    port(
        "calibration_lower_median",
        "Lower of the middle two",
        "no interpolation; right: their mean",
        BOTH,
        edit(SOURCE, MEDIAN, "sorted(ratios)[(len(ratios) - 1) // 2]"),
    ),
    port(
        "calibration_inverted",
        "Ratio of the gradients inverted",
        "g_rgb / g_lap; right: g_lap / g_rgb",
        BOTH,
        edit(SOURCE, RATIOS, "ratios.append(view.photometric / max(view.laplacian, 1e-300))"),
    ),
    port(
        "calibration_over_tissue",
        "RMS over tissue pixels",
        "over pixels with a gradient; right: over all",
        BOTH,
        edit(
            SOURCE,
            "    return math.sqrt(float(np.mean(flat * flat)))",
            "    flat = flat[flat != 0]\n    return math.sqrt(float(np.mean(flat * flat)))",
        ),
    ),
    port(
        "calibration_keeps_dead_view",
        "View without photometric gradient kept",
        "an infinite ratio moves the median; right: dropped",
        "calibration",
        edit(SOURCE, 'return "no photometric gradient"', 'return ""'),
        edit(
            SOURCE,
            "for view in (ViewRms(*v) for v in views)",
            "for view in (ViewRms(n, np.float64(a), np.float64(b)) for n, a, b in views)",
        ),
    ),
    port(
        "calibration_of_nothing",
        "Calibration without a valid view answered",
        "not a number; right: refused",
        "calibration",
        edit(
            SOURCE,
            "    if not ratios:\n",
            "    if not ratios:\n        return Calibration(math.nan, np.zeros(0), table)\n    if not ratios:\n",
        ),
    ),
]
