"""Golden cases of reading and of equations (1) to (5), (7), (B1), (B10)."""

import numpy as np

from endotsr.equations.dictionary import frequencies
from endotsr.golden.cases import Seeds, Spec
from endotsr.golden.generator import Made, changed, given


def omegas(count: int, high: float = 16.0) -> Made:
    """Frequencies as an input: rounded to float32, so that the case does not depend on how they were made."""
    return given(frequencies(count, 1.0, high), f"1 * {high!r}^(k / {count - 1}), rounded", "cycles per sequence")


def scalar(value: float, unit: str = "1") -> Made:
    """A number as an array without axes."""
    return given(np.array(value), repr(value), unit)


def stamps(count: int) -> Made:
    """k / n of all frames."""
    return given(np.arange(count) / count, f"k / {count}")


def train_index(count: int) -> Made:
    """All frames but (k - 1) % 8 == 0."""
    keep = np.flatnonzero((np.arange(count) - 1) % 8 != 0)
    return given(keep, "all k but (k - 1) % 8 == 0", "frame")


def _reading() -> list[Spec]:
    k, c, n = np.meshgrid(np.arange(4), np.arange(3), np.arange(5), indexing="ij")
    y, x = np.meshgrid(np.arange(3), np.arange(4), indexing="ij")
    inputs = {
        "harmonics": given((100.0 * k + 10.0 * c + n) / 8, "(100 k + 10 c + n) / 8 at [k, c, n]"),
        "mask": given((x + 2 * y) % 3 != 0, "(x + 2 y) % 3 != 0"),
        "scalar": scalar(-2.5),
        "empty": given(np.zeros((3, 0)), "no Gaussian"),
    }
    flags = ("fortran_order", "gaussian_first", "mask_inverted", "pixel_corner")
    return [
        Spec("reading", "layout", "reading", "The Gaussian index is the last axis, C order, True is tissue",
             flags, {"gaussian": 3, "row": 1}, inputs),
        Spec("reading", "generator", "generator", "Words of splitmix64 from the FNV-1a hash of a text",
             ("signed_shift",), {"seed": "reading/generator/words", "count": 12}, {}),
    ]  # fmt: skip


def _fourier() -> list[Spec]:
    out = [
        Spec("frequencies", "published", "frequencies", "Eight log-spaced frequencies with exact ends",
             ("frequencies_linear",), {"count": 8, "low": 1.0, "high": 16.0}, {}),
        Spec("frequencies", "one", "frequencies", "One frequency is the lowest", (), 
             {"count": 1, "low": 2.0, "high": 16.0}, {}),
    ]  # fmt: skip
    for case, t, title in (
        ("generic", 0.3671875, "Sines first, then cosines"),
        ("quarter_turns", 0.25, "Exact zeros at quarter turns"),
    ):
        seeds = Seeds("dictionary", case)
        omega = omegas(5) if case == "generic" else given([1.0, 2.0, 3.0, 8.0, 16.0], "1, 2, 3, 8, 16", "cycles")
        inputs = {"t": scalar(t), "omega": omega, "d_phi": seeds.uniform("d_phi", -1.0, 1.0, 10)}
        flags = ("atoms_interleaved", "frequency_without_two_pi", "dictionary_gradient_sign")
        out.append(Spec("dictionary", case, "dictionary", title, flags, {}, inputs))
    for case, count, high, title, flags in (
        ("generic", 21, 8.0, "Statistics over the training stamps only, RMS of the centred atom",
         ("statistics_over_all_frames", "rms_not_centred", "atoms_not_normalised")),
        ("dead_atom", 32, 16.0, "sin(2 pi 16 k/32) is 0 at every stamp: the atom is dead, 0 in value and gradient",
         ("dead_atom_amplified", "rms_not_centred")),
    ):  # fmt: skip
        seeds = Seeds("atoms", case)
        omega = omegas(3, high) if case == "generic" else given([1.0, 4.0, 16.0], "1, 4, 16", "cycles per sequence")
        inputs = {
            "times": stamps(count),
            "train_index": train_index(count),
            "omega": omega,
            "phi": seeds.uniform("phi", -1.0, 1.0, 6),
            "d_phi_bar": seeds.uniform("d_phi_bar", -1.0, 1.0, 6),
        }
        still = ("times", "omega") if case == "dead_atom" else ()
        out.append(Spec("atoms", case, "atoms", title, flags, {}, inputs, still))
    return out


def _residuals() -> list[Spec]:
    out = []
    for case, size, title, flags in (
        ("generic", 0.4, "beta tanh(A phi_bar) / Y00", ("missing_y00", "tanh_missing")),
        ("zero", 0.0, "Zero coefficients: no residual, but a gradient", ("zero_coefficients_zero_gradient",)),
        ("saturated", 4.0, "A saturated residual keeps its bound and its derivative",
         ("tanh_missing", "missing_y00")),
    ):  # fmt: skip
        seeds = Seeds("appearance", case)
        inputs = {
            "appearance_coefficients": seeds.uniform("colour_coefficients", -size, size, 3, 6, 7),
            "phi_bar": seeds.uniform("phi_bar", -1.5, 1.5, 6),
            "d_residual": seeds.uniform("d_residual", -1.0, 1.0, 3, 7),
        }
        out.append(Spec("appearance", case, "appearance", title, flags, {"beta": 0.3}, inputs))
    seeds = Seeds("motion", "generic")
    inputs = {
        "motion_coefficients": seeds.uniform("motion_coefficients", -0.5, 0.5, 3, 6, 7, unit="scene unit"),
        "phi": seeds.uniform("phi", -1.0, 1.0, 6),
        "d_translation": seeds.uniform("d_translation", -1.0, 1.0, 3, 7),
    }
    flags = ("motion_cosines_dropped",)
    out.append(Spec("motion", "generic", "motion", "Translation C phi", flags, {}, inputs))
    for case, length, count in (("published", 0.2, 8), ("short", 0.0, 4), ("long", 5.0, 4)):
        seeds = Seeds("matern", case)
        inputs = {
            "omega": omegas(count),
            "motion_coefficients": seeds.uniform("motion_coefficients", -0.5, 0.5, 3, 2 * count, 6, unit="scene unit"),
            "d_penalty": scalar(1.5),
        }
        flags = ("penalty_over_two", "matern_sum_one") if length == 0 else (
            "matern_sum_one", "matern_inverted", "matern_without_two_pi", "matern_wrong_power", "penalty_over_two",
            "penalty_interleaved",
        )  # fmt: skip
        if case == "long":
            flags = ("matern_sum_one", "matern_inverted", "matern_wrong_power", "penalty_over_two")
        title = {"published": "Weights of mean 1, penalty over 6 N F", "short": "l = 0 weighs all alike",
                 "long": "A long correlation weighs like omega^6"}[case]  # fmt: skip
        out.append(Spec("matern", case, "matern", title, flags, {"correlation_length": length}, inputs))
    return out


def tissue(height: int, width: int, rows: int, columns: int) -> Made:
    """An instrument in the lower right corner."""
    y, x = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    text = f"y < {height - rows} or x < {width - columns}"
    return given((y < height - rows) | (x < width - columns), text)


def _laplacian() -> list[Spec]:
    out = []
    loss_flags = ("mask_before_pyramid", "pyramid_zero_border", "laplacian_over_all_pixels", "upsampling_swapped",
                  "upsampling_nearest", "levels_not_averaged")  # fmt: skip
    rows = [
        ("co_sited", "co_sited", (19, 22), tissue(19, 22, 2, 3), "Odd and even sizes, co-sited", loss_flags),
        ("half_pixel", "half_pixel", (19, 22), tissue(19, 22, 2, 3), "Odd and even sizes, half-pixel", loss_flags),
        ("empty_level", "co_sited", (14, 17), tissue(14, 17, 9, 9), "The mask leaves no valid pixel at level 3: it "
         "adds 0 and the third stays", ("empty_level_rescaled", "mask_before_pyramid")),
        ("no_tissue", "co_sited", (9, 8), given(np.zeros((9, 8), bool), "all False"), "No tissue: 0, not NaN",
         ("mean_of_nothing",)),
        ("tiny", "half_pixel", (2, 3), given(np.ones((2, 3), bool), "all True"), "An image smaller than the filter",
         ("pyramid_zero_border",)),
    ]  # fmt: skip
    for case, rule, shape, mask, title, flags in rows:
        seeds = Seeds("laplacian", case)
        inputs = {
            "rendered": seeds.uniform("rendered", 0.0, 1.0, 3, *shape, unit="display"),
            "observed": seeds.uniform("observed", 0.0, 1.0, 3, *shape, unit="display"),
            "mask": mask,
            "d_loss": scalar(0.75),
        }
        out.append(Spec("laplacian", case, "laplacian", title, flags, {"upsampling": rule, "levels": 3}, inputs))
    equal = Seeds("laplacian", "equal").uniform("observed", 0.0, 1.0, 3, 8, 9, unit="display")
    inputs = {"rendered": equal, "observed": equal, "mask": tissue(8, 9, 1, 2), "d_loss": scalar(1.0)}
    out.append(Spec("laplacian", "equal", "laplacian", "Equal images: loss and gradient exactly 0", ("sign_of_zero",),
                    {"upsampling": "co_sited", "levels": 3}, inputs, ("rendered", "observed")))  # fmt: skip
    return out


def _calibration() -> list[Spec]:
    shape = (5, 3, 3, 4)
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
        lap = seeds.uniform("d_laplacian", -1.0, 1.0, views, *shape[1:], unit="loss per display unit")
        lap = changed(lap, ..., lap.array * steep, "view v times (1, 1/4, 3, 1/2, 2)[v]")
        rgb = seeds.uniform("d_photometric", -1.0, 1.0, views, *shape[1:], unit="loss per display unit")
        rgb = changed(rgb, (slice(None), slice(None), slice(2, None)), 0.0, "rows from 2 on are 0 (excluded)")
        if case == "dead_view":
            rgb = changed(rgb, 1, 0.0, "view 1 is 0")
        if case == "all_dead":
            rgb = changed(rgb, ..., 0.0, "all 0")
        inputs = {"d_photometric": rgb, "d_laplacian": lap}
        own = ("lambda_lap",) if case == "all_dead" else ()
        settings = {"gradient_ratio": 0.25}
        out.append(Spec("calibration", case, "calibration", title, flags, settings, inputs, own=own))
    return out


def _deformation() -> list[Spec]:
    out = []
    shape, t = (10, 3, 5), 0.453125
    for basis in ("quartic", "gaussian"):
        seeds = Seeds("deformation", basis)
        centre = seeds.uniform("fdm_centre", 0.25, 0.65, *shape)
        inputs = {
            "fdm_weight": seeds.uniform("fdm_weight", -1.0, 1.0, *shape, unit="raw parameter"),
            "fdm_centre": centre,
            "fdm_width": changed(seeds.uniform("fdm_width", 0.08, 0.3, *shape), (slice(None), 1),
                                 -seeds.uniform("fdm_width", 0.08, 0.3, *shape).array[:, 1], "basis 1 negated"),
            "t": scalar(t),
            "d_offsets": seeds.uniform("d_offsets", -1.0, 1.0, 10, 5),
        }  # fmt: skip
        flags = ("basis_swapped", "width_without_floor", "width_gradient_of_size", "time_gradient_sign")
        title = f"The {basis} time basis; the sign of a width does not matter, its gradient has it"
        out.append(Spec("deformation", basis, "deformation", title, flags, {"basis": basis}, inputs))
    seeds = Seeds("deformation", "width_zero")
    inputs = {
        "fdm_weight": seeds.uniform("fdm_weight", -1.0, 1.0, 10, 2, 3),
        "fdm_centre": given(np.full((10, 2, 3), 0.4921875), "63/128"),
        "fdm_width": given(np.zeros((10, 2, 3)), "0"),
        "t": scalar(0.5),
        "d_offsets": seeds.uniform("d_offsets", -1.0, 1.0, 10, 3),
    }
    out.append(Spec("deformation", "width_zero", "deformation", "A width of 0 is finite: its square has a floor",
                    ("width_without_floor",), {"basis": "quartic"}, inputs))  # fmt: skip
    return out


def _adam() -> list[Spec]:
    seeds = Seeds("adam", "three_steps")
    gradients = seeds.uniform("gradients", -1.0, 1.0, 3, 4, 5)
    gradients = changed(gradients, (slice(None), 0), gradients.array[:, 0] * 2.0**-24, "[:, 0] times 2^-24")
    gradients = changed(gradients, (slice(None), 3, 4), 0.0, "[:, 3, 4] is 0")
    inputs = {"parameter": seeds.uniform("parameter", -1.0, 1.0, 4, 5), "gradients": gradients}
    settings = {"rate": 0.005, "beta1": 0.9, "beta2": 0.999, "epsilon": 1e-15}
    flags = ("adam_without_bias_correction", "adam_epsilon_in_root", "adam_epsilon_1e-8", "adam_first_step_zero")
    return [Spec("adam", "three_steps", "adam", "Bias correction, epsilon outside the root, a tiny gradient",
                 flags, settings, inputs)]  # fmt: skip


def cases() -> list[Spec]:
    """All of them."""
    return [*_reading(), *_fourier(), *_residuals(), *_laplacian(), *_calibration(), *_deformation(), *_adam()]
