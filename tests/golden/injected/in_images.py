"""Single mistakes for the reference in the image losses, exposure and correction of poses; see in_reference.py."""

from makers.wrong import WrongPort, edit, port

L1, SSIM, DEPTH, SMOOTH = "losses.masked_l1", "losses.masked_ssim", "losses.depth", "losses.smoothness"
EXPOSURE, POSE = "equations.exposure", "equations.pose"


def mistake(flag: str, operations: str, *changes: tuple[str, str, str]) -> WrongPort:
    """A mistake of some changes (module, old text, new text)."""
    return port(flag, "", "", operations, *(edit(*change) for change in changes))


MISTAKES = [
    mistake(
        "l1_over_all_pixels",
        "masked_l1",
        (
            L1,
            "    return float(totals.sum()) / saved.count, saved",
            "    return float(totals.sum()) / rendered.size, saved",
        ),
        (L1, "type(float(d_loss) / saved.count)", "type(float(d_loss) / saved.rendered.size)"),
    ),
    mistake(
        "l1_sum_over_channels",
        "masked_l1",
        (
            L1,
            "    return float(totals.sum()) / saved.count, saved",
            "    return 3 * float(totals.sum()) / saved.count, saved",
        ),
    ),
    mistake(
        "mask_multiplied",
        "masked_l1",
        (
            L1,
            "line[i] = abs(seen[i] - wanted[i]) if tissue[i] else zero",
            "line[i] = abs(seen[i] * tissue[i] - wanted[i] * tissue[i])",
        ),
    ),
    mistake(
        "sign_of_zero",
        "masked_l1",
        (L1, "(-step if difference < zero else zero)", "(-step if difference < zero else step)"),
    ),
    mistake(
        "mean_of_nothing",
        "masked_l1",
        (L1, "    if saved.count == 0:\n        return 0.0, saved\n", ""),
        (
            L1,
            "    return float(totals.sum()) / saved.count, saved",
            "    return float(np.float64(totals.sum()) / saved.count), saved",
        ),
    ),
    mistake(
        "ssim_over_all_pixels",
        "masked_ssim",
        (
            SSIM,
            "    return 1.0 - float(totals.sum()) / target.count, saved",
            "    return 1.0 - float(totals.sum()) / rendered.size, saved",
        ),
        (
            SSIM,
            "dissimilarity[i] = p_loss + p * q_loss if tissue[i] else zero",
            "dissimilarity[i] = p_loss + p * q_loss",
        ),
    ),
    mistake(
        "ssim_window_7",
        "masked_ssim",
        (
            SSIM,
            "    return (weights / weights.sum()).astype(dtype)",
            "    weights[:2] = weights[-2:] = 0\n    return (weights / weights.sum()).astype(dtype)",
        ),
    ),
    mistake("ssim_box_window", "masked_ssim", (SSIM, "WINDOW_SIGMA = 1.5", "WINDOW_SIGMA = 1e9")),
    mistake(
        "ssim_of_unmasked_images",
        "masked_ssim",
        (SSIM, "image = np.where(mask, observed, observed.dtype.type(0))", "image = np.array(observed)"),
        (SSIM, "e[i] = seen[i] - wanted[i] if tissue[i] else zero", "e[i] = seen[i] - wanted[i]"),
        (SSIM, "s[i] = seen[i] + wanted[i] if tissue[i] else zero", "s[i] = seen[i] + wanted[i]"),
    ),
    mistake(
        "depth_holes_count",
        "normalised_depth",
        (DEPTH, "known = np.isfinite(prior_depth) & (prior_depth > 0)", "known = np.isfinite(prior_depth)"),
    ),
    mistake("depth_maximum_constant", "normalised_depth", (DEPTH, "(d_peak if row[i] == peak else zero)", "zero")),
    mistake(
        "depth_every_maximum", "normalised_depth", (DEPTH, "ties = int(np.count_nonzero(depth == peak))", "ties = 1")
    ),
    mistake(
        "depth_few_priors",
        "normalised_depth",
        (DEPTH, "if target.count >= FEWEST_VALID else 0.0", "if target.count > 0 else 0.0"),
    ),
    mistake(
        "ten_priors_ignored",
        "normalised_depth",
        (DEPTH, "if target.count >= FEWEST_VALID else 0.0", "if target.count > FEWEST_VALID else 0.0"),
    ),
    mistake(
        "depth_not_normalised",
        "normalised_depth",
        (
            DEPTH,
            "np.divide(prior_depth, largest, out=normalised, where=known)",
            "np.copyto(normalised, prior_depth, where=known)",
        ),
        (DEPTH, "_largest_finite(rendered_depth) if target", "1.0 if target"),
        (DEPTH, "d_largest = -step * saved.signed_sum / saved.largest", "d_largest, ties = 0.0, 1"),
    ),
    mistake(
        "edges_ignored",
        "smoothness",
        (SMOOTH, '~check_plane("edges", edges, mask.shape)', '(check_plane("edges", edges, mask.shape) | True)'),
    ),
    mistake(
        "variation_of_tissue",
        "smoothness",
        (SMOOTH, "row.dtype.type(0) if tissue[i] else value", "value if tissue[i] else row.dtype.type(0)"),
        (SMOOTH, "factor = 0.0 if mask.all() else float", "factor = float"),
        (SMOOTH, "out[i] = zero if tissue[i] else change", "out[i] = change if tissue[i] else zero"),
    ),
    mistake(
        "smoothness_on_all_pixels", "smoothness", (SMOOTH, "smooth = mask & ~check", "smooth = (mask | ~mask) & ~check")
    ),
    mistake(
        "squared_steps_over_all_pixels",
        "smoothness",
        (SMOOTH, "1.0 / (np.count_nonzero(smooth) + FEW_PIXELS)", "1.0 / smooth.shape[0] / smooth.shape[1]"),
    ),
    mistake(
        "gain_not_exponential",
        "exposure",
        (EXPOSURE, "np.exp(log_gain.astype(np.float64))", "(log_gain.astype(np.float64) + 1.0)"),
    ),
    mistake(
        "bias_before_gain",
        "exposure",
        (
            EXPOSURE,
            "exposed = colour * gain.astype(colour.dtype)[:, None, None]",
            "exposed = (colour + 0) * gain.astype(colour.dtype)[:, None, None]",
        ),
        (
            EXPOSURE,
            "exposed += bias.astype(colour.dtype)[:, None, None]",
            "exposed += (gain * bias).astype(colour.dtype)[:, None, None]",
        ),
    ),
    mistake(
        "exposure_clamped",
        "exposure",
        (EXPOSURE, "    return exposed, ExposureSaved", "    return np.clip(exposed, 0, 1), ExposureSaved"),
    ),
    mistake(
        "rotation_vector_reversed",
        "pose",
        (POSE, "_factors(float(vector @ vector))\n", "_factors(float(vector @ vector))\n    vector = -vector\n"),
        (POSE, "d_vector, d_d.copy())", "-d_vector, d_d.copy())"),
    ),
    mistake(
        "offset_before_rotation",
        "pose",
        (POSE, "a * k + b * (k @ k)\n", "a * k + b * (k @ k)\n    d, offset = d + offset, 0 * d\n"),
        (POSE, "d_vector, d_d.copy())", "d_vector, d_d @ saved.exponential)"),
    ),
    mistake("radial_gradient_dropped", "pose", (POSE, "(a1 * k + b1 * (k @ k))", "(0 * k)")),
]
