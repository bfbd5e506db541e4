"""Family `calibration`: equation (7), the weight of the Laplacian loss from gradient images.

Inputs: photometric and Laplacian gradient images of some views, so the cases include the RMS. The cases have an odd and
an even number of views, a view without photometric gradient, and no valid view.
"""

import numpy as np

from makers.making import Seeds, Spec, changed
from makers.operations import PER_DISPLAY, Declared, Judged

DECLARED = {
    "calibration": Declared(
        {
            "g_rgb": Judged(1, PER_DISPLAY),
            "g_lap": Judged(1, PER_DISPLAY),
            "lambda_lap": Judged(1, oracle="calibration.calibrate"),
            "refused": Judged(1, scale="exact"),
        },
        "axis 0 = views; `g_rgb`, `g_lap` = RMS over all other axes; `refused` True and `lambda_lap` 0 if no view is"
        " valid",
        settings={"gradient_ratio": "loss.gradient_ratio"},
    )
}
OPERATIONS = tuple(DECLARED)


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
