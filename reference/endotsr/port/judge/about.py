"""Descriptions in a request: the page of the equation, and the axes of the arrays by name.

In: an equation and its operation, or the name of an array and the number of its axes. Out: a page of
docs/specification, the axes.
"""

import re

PAGES = {
    "1": "01_dictionary", "1b": "01_dictionary", "2": "02_appearance", "6": "06_objective",
    "B5": "b05_compositing", "B8": "b08_depth", "B10": "b10_adam",
}  # fmt: skip
"""Pages of docs/specification with another name than that of the operation; `b06_masked_l1` is that of (B6)."""

_AXES = {
    "Gaussian": "opacity_logit depth visible pruned cloned split parent moments_kept mean_gradient",
    "row column": "mask depth_image opacity_image rendered_depth prior_depth picture edges valid_1 valid_2 valid_3",
    "rgb row column": "colour_image rendered observed exposed band_1 band_2 band_3 colour",
    "rgb": "background bias log_gain exposure_bias exposure_log_gain",
    "rgb training frame": "exposure_bias exposure_log_gain",
    "rgb Gaussian": "residual residual_at_t colour",
    "xyz": "centre translation rotation_vector offset corrected_translation",
    "xyz Gaussian": "position log_scale scale translation",
    "wxyz Gaussian": "quaternion",
    "row column Gaussian": "rotation",
    "axis axis": "rotation_matrix rotation corrected_rotation",
    "xy Gaussian": "mean2d",
    "abc Gaussian": "covariance2d",
    "view xy Gaussian": "mean2d",
    "view Gaussian": "visible",
    "coefficient rgb Gaussian": "harmonics",
    "rgb atom Gaussian": "appearance_coefficients",
    "xyz atom Gaussian": "motion_coefficients",
    "offset base Gaussian": "fdm_weight fdm_centre fdm_width",
    "offset Gaussian": "offsets",
    "atom": "phi phi_bar mean rms dead",
    "frequency": "omega rho",
    "frame": "times",
    "training frame": "train_index",
    "xyz point": "points",
    "point": "reference residual seen",
    "view": "g_rgb g_lap",
    "view rgb row column": "photometric laplacian",
    "frame rgb row column": "images",
    "frame row column": "masks prior_depths",
    "frame axis axis": "rotation_matrices",
    "frame xyz": "translations",
    "child xyz Gaussian": "split_noise",
    "iteration": "iteration frame_order loss first_moments second_moments gradient_sum visits laplacian_weight degree "
                 "residuals smoothness gathers densifies count",
    "step row column": "gradients",
    "row column (of any array)": "parameter first second empty",
    "coefficient rgb": "column",
    "entry": "flat words unit_numbers",
    "tissue column": "tissue_row",
    "column": "sample_x",
    "row": "sample_y",
}  # fmt: skip
_COUNTED = {"training frame": 1, "rgb training frame": 2, "tissue column": 1, "row column (of any array)": 2}
_BY_NAME = {
    (name, _COUNTED.get(axes, len(axes.split()))): axes for axes, names in _AXES.items() for name in names.split()
}
_ITERATIONS = ("rate_", "term_", "square_")


def page_of(equation: str, operation: str) -> str:
    """The page of the equation of an operation, "" for an operation without an equation."""
    number = re.sub(r"\d+", lambda digits: digits[0].zfill(2), equation.lower())
    return f"docs/specification/{PAGES.get(equation, f'{number}_{operation}')}.md" if equation else ""


def axes_of(name: str, count: int) -> str:
    """The axes of an array by name, outermost first; "" for a number.

    `d_x`, `final_x`, `x_after` and `x_at_t` have the axes of `x`. "row column Gaussian" of `rotation` are the two axes
    of the matrix; "axis axis" is a single matrix.

    Raises:  KeyError for an array that `_AXES` lacks.
    """
    if count == 0:
        return ""
    if name.startswith(_ITERATIONS) and count == 1:
        return "iteration"
    for prefix in ("d_", "final_"):
        name = name.removeprefix(prefix)
    for suffix in ("_after", "_at_t", "_1", "_2"):
        if (name, count) not in _BY_NAME:
            name = name.removesuffix(suffix)
    if (name, count) not in _BY_NAME:
        raise KeyError(
            f"{name!r} with {count} axes is not in `_AXES` of endotsr/port/judge/about.py: add the name there"
        )
    return _BY_NAME[name, count]
