"""Wrong ports of reading and of equations (1) to (5), (7), (B1), (B10)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.negative import Negative, Request, output, setting, swapped
from endotsr.kernels.constants import Y00


def _signed_words(request: Request) -> dict[str, NDArray]:
    """A signed right shift smears the sign bit."""
    from endotsr.stages.words import GAMMA, MIX_1, MIX_2, fnv1a

    count = request.settings["count"]
    with np.errstate(over="ignore"):
        z = np.uint64(fnv1a(request.settings["seed"])) + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(GAMMA)
        signed = z.astype(np.int64)
        signed = (signed ^ (signed >> 30)) * np.uint64(MIX_1).astype(np.int64)
        signed = (signed ^ (signed >> 27)) * np.uint64(MIX_2).astype(np.int64)
        found = (signed ^ (signed >> 31)).astype(np.uint64)
    return {"words": found, "unit_numbers": (found >> np.uint64(40)).astype(np.float64) / 2.0**24}


def _interleaved(request: Request) -> dict[str, NDArray]:
    phi = request.right["phi"]
    return {"phi": phi.reshape(2, -1).T.reshape(-1)}


def _atoms(request: Request, *, all_frames: bool = False, centred: bool = True, dead: bool = True) -> dict[str, Any]:
    times, omega = request.inputs["times"].astype(float), request.inputs["omega"].astype(float)
    used = times if all_frames else times[request.inputs["train_index"]]
    phase = 2 * np.pi * used[:, None] * omega
    rows = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    mean = rows.mean(axis=0)
    rms = np.sqrt(((rows - (mean if centred else 0)) ** 2).mean(axis=0))
    gone = (rms < 1e-6) if dead else np.zeros(rms.shape, bool)
    gain = np.where(gone, 0.0, 1 / np.where(rms > 0, rms, 1e-300))
    phi_bar = (request.inputs["phi"] - mean) * gain
    return {"mean": mean, "rms": rms, "dead": gone, "phi_bar": phi_bar, "d_phi": request.inputs["d_phi_bar"] * gain}


def _linear_colour(request: Request) -> dict[str, NDArray]:
    a, atoms, d = (request.inputs[n] for n in ("appearance_coefficients", "phi_bar", "d_residual"))
    scale = request.settings["beta"] / Y00
    return {
        "residual": scale * np.einsum("cai,a->ci", a, atoms),
        "d_appearance_coefficients": scale * np.einsum("ci,a->cai", d, atoms),
        "d_phi_bar": scale * np.einsum("ci,cai->a", d, a),
    }


def _scaled(factor: float, *names: str):
    return output(**{name: (lambda a: a * factor) for name in names})


def _no_cosines(request: Request) -> dict[str, NDArray]:
    phi = request.inputs["phi"].copy()
    phi[phi.size // 2 :] = 0
    return request.run(dict(request.inputs) | {"phi": phi}, request.settings)


def _matern(density) -> Any:
    """Answers with weights rho(l, angular frequency), whatever their normalisation."""

    def wrong(request: Request) -> dict[str, Any]:
        length, omega = request.settings["correlation_length"], request.inputs["omega"].astype(float)
        rho = density(length, omega)
        c, up = request.inputs["motion_coefficients"], float(request.inputs["d_penalty"])
        both = np.concatenate([rho, rho])[None, :, None]
        norm = c.size  # 3 * 2F * N
        return {
            "rho": rho,
            "penalty": (both * c**2).sum() / norm,
            "d_motion_coefficients": up * 2 * both * c / norm,
        }

    return wrong


def _raw(length: float, angular: NDArray, power: float = 3.0) -> NDArray:
    return (5 + (length * angular) ** 2) ** power


def _mean_one(rho: NDArray) -> NDArray:
    return rho / rho.mean()


def _interleaved_penalty(request: Request) -> dict[str, Any]:
    c, rho, up = request.inputs["motion_coefficients"], request.right["rho"], float(request.inputs["d_penalty"])
    both = np.repeat(rho, 2)[None, :, None]
    return {"penalty": (both * c**2).sum() / c.size, "d_motion_coefficients": up * 2 * both * c / c.size}


# ---- the pyramid with switches ----


def _filter(n: int, border: str) -> NDArray:
    out = np.zeros(((n + 1) // 2, n))
    for row in range(out.shape[0]):
        for tap, weight in zip(range(-2, 3), (1, 4, 6, 4, 1)):
            k = 2 * row + tap
            if border == "mirror":
                period = max(2 * (n - 1), 1)
                k = abs(k) % period
                k = min(k, period - k) if n > 1 else 0
            if 0 <= k < n:
                out[row, k] += weight / 16
    return out


def _expand(n: int, rule: str) -> NDArray:
    m = (n + 1) // 2
    fine = {"co_sited": np.arange(n) / 2, "half_pixel": (np.arange(n) + 0.5) / 2 - 0.5}.get(rule, np.arange(n) // 2)
    return np.stack([np.interp(fine, np.arange(m), row) for row in np.eye(m)], axis=1)


def laplacian_with(request: Request, *, border="mirror", rule=None, masks="support", divide="valid",
                   levels_mean=True, rescale=False) -> dict[str, Any]:  # fmt: skip
    """Equation (5) by dense matrices, one thing different."""
    rule = rule or request.settings["upsampling"]
    mask = request.inputs["mask"]
    difference = np.where(mask, request.inputs["rendered"] - request.inputs["observed"], 0.0)
    observed = request.inputs["observed"].astype(float)
    up = float(request.inputs["d_loss"])
    height, width = mask.shape
    down_y, down_x = np.eye(height), np.eye(width)
    out: dict[str, Any] = {}
    parts, gradients = [], []
    shrunk = mask
    for level in range(request.settings["levels"]):
        h, w = down_y.shape[0], down_x.shape[0]
        ry, rx, ey, ex = _filter(h, border), _filter(w, border), _expand(h, rule), _expand(w, rule)
        next_y, next_x = ry @ down_y, rx @ down_x

        smooth_y, smooth_x = ey @ next_y, ex @ next_x
        band_of = [down_y @ i @ down_x.T - smooth_y @ i @ smooth_x.T for i in (difference, observed)]
        valid = request.right[f"valid_{level + 1}"] if masks == "support" else shrunk
        sign = np.sign(band_of[0]) * valid
        count = 3 * (valid.sum() if divide == "valid" else valid.size)
        parts.append(np.abs(band_of[0] * valid).sum() / count if count else None)
        g = down_y.T @ sign @ down_x - smooth_y.T @ sign @ smooth_x
        gradients.append(g / max(count, 1))
        out[f"band_{level + 1}"], out[f"valid_{level + 1}"] = band_of[1], valid
        down_y, down_x, shrunk = next_y, next_x, shrunk[::2, ::2]
    present = [p for p in parts if p is not None]
    share = 1.0 if not levels_mean else 1.0 / (len(present) if rescale and present else len(parts))
    out["loss"] = share * sum(present)
    out["d_rendered"] = np.where(mask, up * share * sum(gradients), 0.0)
    return out


def _laplacian(**switches: Any):
    return {"laplacian": lambda request: laplacian_with(request, **switches)}


def _nan(*names: str):
    """Where the right answer is that of nothing: not a number."""

    def wrong(request: Request) -> dict[str, NDArray] | None:
        if request.inputs["mask"].any():
            return None
        return {name: np.full_like(request.right[name], np.nan) for name in names if name in request.right}

    return wrong


def _sign_of_zero(request: Request) -> dict[str, NDArray] | None:
    """sign(0) = 1: equal images pull."""
    if not np.array_equal(request.inputs["rendered"], request.inputs["observed"]):
        return None
    mask = request.inputs["mask"]
    step = float(request.inputs["d_loss"]) / (3 * mask.sum())
    return {"d_rendered": np.where(mask, step, 0.0) * np.ones_like(request.right["d_rendered"])}


# ---- calibration ----


def _weight(reduce):
    def wrong(request: Request) -> dict[str, Any] | None:
        rgb, lap = request.right["g_rgb"], request.right["g_lap"]
        value = reduce(rgb, lap, request.settings["gradient_ratio"])
        return None if value is None else {"lambda_lap": value}

    return wrong


def _live(rgb: NDArray, lap: NDArray) -> NDArray:
    return (lap / rgb)[rgb > 0]


def _over_tissue(request: Request) -> dict[str, Any]:
    """RMS over the pixels that have a gradient."""
    rgb, lap = request.inputs["d_photometric"], request.inputs["d_laplacian"]
    g = np.array([np.sqrt((v[v != 0] ** 2).mean()) if v.any() else 0.0 for v in rgb])
    h = np.sqrt((lap**2).mean(axis=(1, 2, 3)))
    live = g > 0
    if not live.any():
        return {}
    return {"g_rgb": g, "lambda_lap": request.settings["gradient_ratio"] / np.median(h[live] / g[live])}


def _deformation(spread, basis=None):
    def wrong(request: Request) -> dict[str, NDArray]:
        w, m, s = (request.inputs[f"fdm_{n}"] for n in ("weight", "centre", "width"))
        u = (float(request.inputs["t"]) - m) ** 2
        quartic = request.settings["basis"] == "quartic"
        e = np.exp(-((u / spread(s)) ** 2)) if quartic else np.exp(-u / (2 * spread(s)))
        e = np.where(np.isnan(e), np.nan, e)
        return {"offsets": (w * e).sum(axis=1), "d_fdm_weight": request.inputs["d_offsets"][:, None] * e}

    return wrong


def _adam(root=lambda v, eps: np.sqrt(v) + eps, corrected=True, epsilon=None):
    def wrong(request: Request) -> dict[str, NDArray]:
        p = request.inputs["parameter"].copy()
        beta1, beta2 = request.settings["beta1"], request.settings["beta2"]
        eps = request.settings["epsilon"] if epsilon is None else epsilon
        m, v = np.zeros_like(p), np.zeros_like(p)
        for k, g in enumerate(request.inputs["gradients"], start=1):
            m, v = beta1 * m + (1 - beta1) * g, beta2 * v + (1 - beta2) * g * g
            mm, vv = (m / (1 - beta1**k), v / (1 - beta2**k)) if corrected else (m, v)
            p = p - request.settings["rate"] * mm / root(vv, eps)
        return {"parameter_after": p}

    return wrong


def _late_adam(request: Request) -> dict[str, NDArray]:
    inputs = dict(request.inputs) | {"gradients": request.inputs["gradients"][1:]}
    return request.run(inputs, request.settings)


NEGATIVES = [
    Negative("fortran_order", "Array read in Fortran order", "first index fastest; right: last index fastest",
             {"reading": output(flat=lambda a: a.reshape(4, 3, 5).reshape(-1, order="F"))}),
    Negative("gaussian_first", "Gaussian index taken as the first axis", "[n, ...]; right: [..., n]",
             {"reading": lambda r: {"column": r.inputs["harmonics"].reshape(5, 4, 3)[3]}}),
    Negative("mask_inverted", "Mask read the wrong way round", "True = instrument; right: True = tissue",
             {"reading": lambda r: {"tissue_pixels": (~r.inputs["mask"]).sum(),
                                    "tissue_row": np.flatnonzero(r.inputs["mask"][1])}}),
    Negative("pixel_corner", "Pixels sampled at their corner", "column i at i; right: at i + 1/2",
             {"reading": output(sample_x=lambda a: a - 0.5, sample_y=lambda a: a - 0.5)}),
    Negative("signed_shift", "Generator with signed right shifts", "shifts copy the sign; right: shift in zeros",
             {"generator": _signed_words}),
    Negative("frequencies_linear", "Frequencies spaced linearly", "linspace; right: geomspace",
             {"frequencies": lambda r: {"omega": np.linspace(r.settings["low"], r.settings["high"],
                                                             r.settings["count"])}}),
    Negative("atoms_interleaved", "Sines and cosines interleaved", "[sin, cos, sin, ...]; right: all sines first",
             {"dictionary": _interleaved}),
    Negative("frequency_without_two_pi", "Frequency taken as angular", "sin(w t); right: sin(2 pi w t)",
             {"dictionary": swapped(lambda i: {"omega": i["omega"] / (2 * np.pi)})}),
    Negative("dictionary_gradient_sign", "Derivative of the cosine without its sign", "+sin; right: -sin",
             {"dictionary": lambda r: {n: r.run(dict(r.inputs) | {"d_phi": r.inputs["d_phi"] * np.repeat(
                 [1.0, -1.0], r.inputs["d_phi"].size // 2)}, r.settings)[n] for n in ("d_t", "d_omega")}}),
    Negative("statistics_over_all_frames", "Atom statistics over test frames too",
             "mean and RMS over all stamps; right: over the training stamps",
             {"atoms": lambda r: _atoms(r, all_frames=True),
              "scene": swapped(lambda i: {"train_index": np.arange(i["times"].size)})}),
    Negative("rms_not_centred", "RMS of the atom itself", "sqrt(mean phi^2); right: of phi - mean",
             {"atoms": lambda r: _atoms(r, centred=False)}),
    Negative("atoms_not_normalised", "Atoms centred but not divided by their RMS", "phi - mean; right: over RMS",
             {"atoms": lambda r: {"phi_bar": r.inputs["phi"] - r.right["mean"], "d_phi": r.inputs["d_phi_bar"]}}),
    Negative("dead_atom_amplified", "Dead atom divided by rounding noise", "1 / rms; right: 0",
             {"atoms": lambda r: _atoms(r, dead=False) if r.right["dead"].any() else None}),
    Negative("missing_y00", "1 / Y00 missing in the colour residual", "beta tanh; right: beta tanh / Y00",
             {"appearance": _scaled(Y00, "residual", "d_appearance_coefficients", "d_phi_bar"),
              "scene": _scaled(Y00, "residual_at_t")}),
    Negative("tanh_missing", "Colour residual not bounded", "beta A phi_bar; right: beta tanh(A phi_bar)",
             {"appearance": _linear_colour}),
    Negative("zero_coefficients_zero_gradient", "No gradient to zero coefficients",
             "component skipped while it is 0; right: its gradient starts it",
             {"appearance": lambda r: {"d_appearance_coefficients": 0 * r.right["d_appearance_coefficients"]}
              if not r.inputs["appearance_coefficients"].any() else None}),
    Negative("motion_cosines_dropped", "Cosines left out of the motion", "sines only; right: both",
             {"motion": _no_cosines}),
    Negative("matern_sum_one", "Matern weights scaled to sum 1", "sum; right: mean 1",
             {"matern": _matern(lambda l, w: _mean_one(_raw(l, 2 * np.pi * w)) / w.size)}),
    Negative("matern_inverted", "Spectral density itself as weight", "low frequencies pay; right: high ones",
             {"matern": _matern(lambda l, w: _mean_one(_raw(l, 2 * np.pi * w, -3.0)))}),
    Negative("matern_without_two_pi", "Matern weights of w in place of 2 pi w", "5/l^2 + w^2; right: (2 pi w)^2",
             {"matern": _matern(lambda l, w: _mean_one(_raw(l, w)))}),
    Negative("matern_wrong_power", "Power of Matern-3/2 or 5/2 in place of 3", "^(5/2); right: ^3",
             {"matern": _matern(lambda l, w: _mean_one(_raw(l, 2 * np.pi * w, 2.5)))}),
    Negative("penalty_over_two", "Penalty over 2 N F", "sum over axes; right: 1 / (6 N F)",
             {"matern": _scaled(3.0, "penalty", "d_motion_coefficients")}),
    Negative("penalty_interleaved", "Weights of interleaved atoms in the penalty",
             "rho repeated pairwise; right: rho for the sines, then for the cosines", {"matern": _interleaved_penalty}),
    Negative("mask_before_pyramid", "Mask applied to the images instead of the support",
             "all band pixels under the subsampled mask; right: those whose whole footprint is tissue",
             _laplacian(masks="image")),
    Negative("pyramid_zero_border", "Zero border in the binomial filter", "zeros outside; right: reflect-101",
             _laplacian(border="zero")),
    Negative("laplacian_over_all_pixels", "Detail loss averaged over all band pixels", "over all; right: valid ones",
             _laplacian(divide="all")),
    Negative("upsampling_swapped", "The other up-sampling rule", "half-pixel for co-sited or back",
             {"laplacian": lambda r: laplacian_with(r, rule="half_pixel" if r.settings["upsampling"] == "co_sited"
                                                    else "co_sited"),
              "objective": setting(loss__upsampling=lambda old: "half_pixel" if old == "co_sited" else "co_sited")}),
    Negative("upsampling_nearest", "Nearest-neighbour up-sampling", "repeats samples; right: linear interpolation",
             _laplacian(rule="nearest")),
    Negative("levels_not_averaged", "Levels added, not averaged", "sum; right: 1/3 of it",
             _laplacian(levels_mean=False)),
    Negative("empty_level_rescaled", "Average over the levels that are not empty", "1/2; right: the 1/3 stays",
             {"laplacian": lambda r: laplacian_with(r, rescale=True),
              "objective": lambda r: setting(loss__lambda_lap=lambda old: old * 1.5)(r)
              if r.inputs["mask"].mean() < 0.8 else None}),
    Negative("mean_of_nothing", "Mean over no pixels", "0 / 0; right: a defined value",
             {"laplacian": _nan("loss", "d_rendered"), "masked_l1": _nan("loss", "d_rendered"),
              "masked_ssim": _nan("ssim", "d_rendered")}),
    Negative("sign_of_zero", "sign(0) = 1", "a pull between equal images; right: none",
             {"laplacian": _sign_of_zero, "masked_l1": _sign_of_zero}),
    Negative("calibration_mean", "Mean over the views", "mean; right: median",
             {"calibration": _weight(lambda a, b, r: r / _live(a, b).mean() if (a > 0).any() else None)}),
    Negative("calibration_lower_median", "Lower of the middle two", "no interpolation; right: their mean",
             {"calibration": _weight(lambda a, b, r: r / np.sort(_live(a, b))[(_live(a, b).size - 1) // 2]
                                     if (a > 0).any() else None)}),
    Negative("calibration_inverted", "Ratio of the gradients inverted", "g_rgb / g_lap; right: g_lap / g_rgb",
             {"calibration": _weight(lambda a, b, r: r / np.median(1 / _live(a, b)) if (a > 0).any() else None)}),
    Negative("calibration_over_tissue", "RMS over tissue pixels", "over pixels with a gradient; right: over all",
             {"calibration": _over_tissue}),
    Negative("calibration_keeps_dead_view", "View without photometric gradient kept",
             "an infinite ratio moves the median; right: dropped",
             {"calibration": _weight(lambda a, b, r: r / np.median(np.where(a > 0, b / np.where(a > 0, a, 1), np.inf))
                                     if (a > 0).any() else None)}),
    Negative("calibration_of_nothing", "Calibration without a valid view answered", "not a number; right: refused",
             {"calibration": lambda r: {"refused": np.array(False), "lambda_lap": np.nan}
              if r.right["refused"] else None}),
    Negative("basis_swapped", "The other time basis", "Gaussian for quartic or back",
             {"deformation": setting(basis=lambda old: "gaussian" if old == "quartic" else "quartic"),
              "scene": setting(model__basis=lambda old: "gaussian" if old == "quartic" else "quartic")}),
    Negative("width_without_floor", "Squared width without its floor", "s^2; right: s^2 + 1e-4",
             {"deformation": _deformation(lambda s: s**2)}),
    Negative("width_gradient_of_size", "Gradient by the size of the width", "sign lost; right: that of the width",
             {"deformation": lambda r: {"d_fdm_width": r.right["d_fdm_width"] * np.where(r.inputs["fdm_width"] < 0,
                                                                                         -1.0, 1.0)}}),
    Negative("time_gradient_sign", "Gradient by time with the sign of the centre", "+; right: minus the sum",
             {"deformation": output(d_t=lambda a: -a)}),
    Negative("adam_without_bias_correction", "Adam without bias correction", "m / sqrt(v); right: corrected",
             {"adam": _adam(corrected=False)}),
    Negative("adam_epsilon_in_root", "Epsilon inside the root", "sqrt(v + eps); right: sqrt(v) + eps",
             {"adam": _adam(lambda v, eps: np.sqrt(v + eps))}),
    Negative("adam_epsilon_1e-8", "Adam's usual epsilon", "1e-8; right: 1e-15", {"adam": _adam(epsilon=1e-8)}),
    Negative("adam_first_step_zero", "First gradient not stepped on", "one step late; right: k counts from 1",
             {"adam": _late_adam}),
]  # fmt: skip
