"""Single mistakes for the port in C99: which text of which file is replaced, and the name that the judge has to give.

Each is written as a programmer of that port would make it: often in the forward pass alone, or in one of two places.
"""

from typing import NamedTuple

Change = tuple[str, str]  # old text, which occurs once, and new text


class Injected(NamedTuple):
    """One mistake."""

    flag: str
    file: str
    changes: tuple[Change, ...]


def mistake(flag: str, file: str, *changes: Change) -> Injected:
    """A mistake of some changes in one file."""
    return Injected(flag, file, changes)


READING = [
    mistake("gaussian_first", "reading.c", ("array[k * count + gaussian]", "array[gaussian * rows + k]")),
    mistake(
        "mask_inverted",
        "reading.c",
        ("tissue += mask[p]", "tissue += !mask[p]"),
    ),
    mistake(
        "pixel_corner",
        "reading.c",
        ("sample_x[x] = (real)x + (real)0.5", "sample_x[x] = (real)x"),
        ("sample_y[y] = (real)y + (real)0.5", "sample_y[y] = (real)y"),
    ),
    mistake(
        "signed_shift",
        "reading.c",
        ("z ^ z >> 30", "z ^ (uint64_t)((int64_t)z >> 30)"),
        ("z ^ z >> 27", "z ^ (uint64_t)((int64_t)z >> 27)"),
        ("z ^ z >> 31", "z ^ (uint64_t)((int64_t)z >> 31)"),
    ),
]
TIME = [
    mistake(
        "frequencies_linear",
        "time.c",
        (
            "low * pow(high / low, (double)f / (double)(count - 1))",
            "low + (high - low) * (double)f / (double)(count - 1)",
        ),
    ),
    mistake(
        "frequency_without_two_pi",
        "time.c",
        ("double r = p - round(p);", "p /= 2.0 * PI;\n    double r = p - round(p);"),
        ("2.0 * PI * (d_phi[f]", "(d_phi[f]"),
    ),
    mistake("dictionary_gradient_sign", "time.c", ("* c - d_phi[count + f] * s", "* c + d_phi[count + f] * s")),
    mistake(
        "atoms_interleaved",
        "time.c",
        ("phi[f] = (real)s;\n        phi[count + f]", "phi[2 * f] = (real)s;\n        phi[2 * f + 1]"),
        ("d_phi[f] * c - d_phi[count + f] * s", "d_phi[2 * f] * c - d_phi[2 * f + 1] * s"),
    ),
    mistake("repeated_stamps_counted", "time.c", ("            return true;", "            return false;")),
    mistake("rms_not_centred", "time.c", ("times[train[j]]) - sum / distinct, 2.0)", "times[train[j]]), 2.0)")),
    mistake(
        "atoms_not_normalised",
        "time.c",
        ("(phi[k] - sum / distinct) / spread", "phi[k] - sum / distinct"),
        ("(d_phi_bar[k] / spread)", "d_phi_bar[k]"),
    ),
    mistake("atoms_not_centred", "time.c", ("(phi[k] - sum / distinct) / spread", "phi[k] / spread")),
    mistake("dead_atom_amplified", "time.c", ("DEAD = 1e-6", "DEAD = 0.0")),
    mistake("missing_y00", "time.c", ('setting(request, "beta") / Y00', 'setting(request, "beta")')),
    mistake(
        "tanh_missing",
        "time.c",
        ("scale * tanh(x[k])", "scale * x[k]"),
        ("scale * 4 * e / ((1 + e) * (1 + e)) * d_residual[k]", "scale * d_residual[k] + 0 * e"),
    ),
    mistake(
        "tanh_gradient_missing",
        "time.c",
        ("scale * 4 * e / ((1 + e) * (1 + e)) * d_residual[k]", "scale * d_residual[k] + 0 * e"),
    ),
    mistake(
        "motion_cosines_dropped",
        "time.c",
        (
            'count = in_size(request, "d_translation", 1);',
            'count = in_size(request, "d_translation", 1);\n    real *sines = scratch(request, terms);\n'
            "    memcpy(sines, phi, (size_t)(terms / 2) * sizeof *phi);\n    phi = sines;",
        ),
    ),
    mistake("matern_sum_one", "time.c", ("* (double)count / sum", "/ sum")),
    mistake(
        "matern_wrong_power",
        "time.c",
        ("(1.0 + s), 3.0)", "(1.0 + s), 2.5)"),
        ("(5.0 + pow(length * largest, 2.0)), 3.0)", "(5.0 + pow(length * largest, 2.0)), 2.5)"),
    ),
    mistake(
        "matern_inverted",
        "time.c",
        ("(1.0 + s), 3.0)", "(1.0 + s), -3.0)"),
        ("(5.0 + pow(length * largest, 2.0)), 3.0)", "(5.0 + pow(length * largest, 2.0)), -3.0)"),
    ),
    mistake(
        "matern_without_two_pi",
        "time.c",
        ("fmax(largest, 2.0 * PI * omega[f])", "fmax(largest, omega[f])"),
        ("sum += unnormalised(length, 2.0 * PI * omega[f]", "sum += unnormalised(length, omega[f]"),
        ("weight = unnormalised(length, 2.0 * PI * omega[f]", "weight = unnormalised(length, omega[f]"),
    ),
    mistake("penalty_over_two", "time.c", ("norm = 6.0 *", "norm = 2.0 *")),
    mistake("penalty_gradient_without_two", "time.c", ("2.0 * weight / norm", "weight / norm")),
    mistake(
        "penalty_interleaved", "time.c", ("long k = f; k < 2 * count; k += count", "long k = 2 * f; k < 2 * f + 2; k++")
    ),
    mistake("basis_swapped", "time.c", ("bool quartic = setting_is", "bool quartic = !setting_is")),
    mistake(
        "basis_gaussian_without_half",
        "time.c",
        ("exp(-u / 2)", "exp(-u)"),
        (": up * step;", ": 2 * up * step;"),
        (": up * u * width[at];", ": 2 * up * u * width[at];"),
    ),
    mistake("width_without_floor", "time.c", ("WIDTH_FLOOR = 1e-4", "WIDTH_FLOOR = 0.0")),
    mistake(
        "width_gradient_of_size",
        "time.c",
        (
            "4 * up * u * u * width[at] : up * u * width[at]",
            "4 * up * u * u * fabs(width[at]) : up * u * fabs(width[at])",
        ),
    ),
    mistake("time_gradient_sign", "time.c", ("d_t -= d_centre[at]", "d_t += d_centre[at]")),
]
BINOMIAL = "real weight = (real)(BINOMIAL[r] * BINOMIAL[s]);"
INSIDE = "2 * y + r >= 2 && 2 * y + r - 2 < size.height && 2 * x + s >= 2 && 2 * x + s - 2 < size.width"
MEDIAN = "(ratios[(kept - 1) / 2] + ratios[kept / 2]) / 2.0"
LAPLACIAN = [
    mistake(
        "pyramid_replicated_border",
        "laplacian.c",
        (
            "    k = ((k % period) + period) % period;\n    return k < n ? k : period - k;",
            "    (void)period;\n    return k < 0 ? 0 : k < n ? k : n - 1;",
        ),
    ),
    mistake(
        "pyramid_zero_border",
        "laplacian.c",
        (BINOMIAL, f"real weight = {INSIDE} ? (real)(BINOMIAL[r] * BINOMIAL[s]) : 0;"),
    ),
    mistake("upsampling_swapped", "laplacian.c", ("bool co_sited = setting_is", "bool co_sited = !setting_is")),
    mistake(
        "upsampling_nearest",
        "laplacian.c",
        ("weight[0] = co_sited ? (fine % 2 ? (real)0.5 : 1) : (real)0.75;", "weight[0] = 1;"),
    ),
    mistake(
        "support_subsampled",
        "laplacian.c",
        (
            "coarse[y * half.width + x] = all;",
            "coarse[y * half.width + x] = (uint8_t)(fine[2 * y * size.width + 2 * x] + 0 * all);",
        ),
    ),
    mistake(
        "support_not_expanded",
        "laplacian.c",
        ("if (wy[k / 2] * wx[k % 2] != 0)\n                    all", "if (k > 4)\n                    all"),
    ),
    mistake(
        "laplacian_over_all_pixels",
        "laplacian.c",
        ("(3.0 * levels * (double)counts[j])", "(3.0 * levels * (double)area(sizes[j]) + 0.0 * (double)counts[j])"),
    ),
    mistake("levels_not_averaged", "laplacian.c", ("(3.0 * levels * (double)counts[j])", "(3.0 * (double)counts[j])")),
    mistake(
        "sign_of_zero",
        "laplacian.c",
        ("valid[j][p] && value != 0", "valid[j][p]"),
        ("(value > 0 ? share", "(value >= 0 ? share"),
    ),
    mistake(
        "mask_multiplied",
        "laplacian.c",
        (
            "mask[p] ? rendered[channel * pixels + p] - observed[channel * pixels + p] : 0",
            "mask[p] * (rendered[channel * pixels + p] - observed[channel * pixels + p])",
        ),
    ),
    mistake(
        "mean_of_nothing",
        "laplacian.c",
        (
            "counted ? 1.0 / (3.0 * levels * (double)counts[j]) : 0.0",
            "(counted ? 1.0 : 0.0) / (3.0 * levels * (double)counts[j])",
        ),
    ),
    mistake("calibration_lower_median", "laplacian.c", (MEDIAN, "ratios[(kept - 1) / 2]")),
    mistake("calibration_inverted", "laplacian.c", ("ratios[kept++] = lap / rgb", "ratios[kept++] = rgb / lap")),
    mistake("calibration_keeps_dead_view", "laplacian.c", ("rgb > 0.0 && isfinite(lap / rgb)", "lap >= 0.0")),
    mistake(
        "calibration_over_tissue",
        "laplacian.c",
        (
            "    double sum = 0.0;\n    for (long k = 0; k < count; k++)\n",
            "    double sum = 0.0;\n    long all = count;\n    for (long k = 0; k < all; k++)\n      "
            "  count -= values[k] == 0;\n    for (long k = 0; k < all; k++)\n",
        ),
    ),
]
D_Q = "(d_q[k] - along * q[k]) * inverse_norm"
PROJECTION = [
    mistake(
        "quaternion_xyzw",
        "projection.c",
        ("fmax(largest, fabs(raw[k * count]))", "fmax(largest, fabs(raw[(k + 3) % 4 * count]))"),
        ("largest > 0 ? raw[k * count]", "largest > 0 ? raw[(k + 3) % 4 * count]"),
        ("d_quaternion[k * count + i]", "d_quaternion[(k + 3) % 4 * count + i]"),
    ),
    mistake(
        "rotation_transposed",
        "projection.c",
        ("r[k / 3][k % 3] = rows[k / 3][k % 3]", "r[k / 3][k % 3] = rows[k % 3][k / 3]"),
    ),
    mistake("quaternion_gradient_without_norm", "projection.c", (D_Q, "d_q[k] + 0 * along * inverse_norm")),
    mistake("quaternion_gradient_not_divided", "projection.c", (D_Q, "(d_q[k] - along * q[k]) + 0 * inverse_norm")),
    mistake(
        "zero_quaternion",
        "projection.c",
        ("largest > 0 ? raw[k * count] / largest : (real)(k == 0)", "raw[k * count] / largest"),
        ("turns ? (d_q[k]", "turns || 1 ? (d_q[k]"),
    ),
    mistake(
        "scale_gradient_without_scale",
        "projection.c",
        ("clipped ? 0 : scale[k * count + i] * d_scale", "clipped ? 0 : d_scale"),
    ),
    mistake(
        "log_scale_gradient_zero_on_limit",
        "projection.c",
        ("fabs(s) > LARGEST_LOG_SCALE", "fabs(s) >= LARGEST_LOG_SCALE"),
    ),
    mistake("log_scale_gradient_through_clip", "projection.c", ("fabs(s) > LARGEST_LOG_SCALE", "fabs(s) > 1000")),
    mistake("log_scale_not_clipped", "projection.c", ("LARGEST_LOG_SCALE = 40", "LARGEST_LOG_SCALE = 700")),
    mistake("low_pass_missing", "projection.c", ("e == 1 ? 0 : lens.low_pass", "0 * lens.low_pass")),
    mistake(
        "jacobian_clamp_missing",
        "projection.c",
        ('real clamp = (real)setting(request, "raster.jacobian_clamp")', "real clamp = 0"),
    ),
    mistake("clamp_term_twice", "projection.c", ("view->clamped[r] && !lens->twice", "view->clamped[r] && 0")),
    mistake(
        "clamp_gradient_passed",
        "projection.c",
        ("(view->clamped[r] ? 0 : d_at)", "d_at"),
        ("view->clamped[r] && !lens->twice", "view->clamped[r] && 0"),
    ),
    mistake("near_plane_zero", "projection.c", ('(real)setting(request, "raster.near")', "0")),
    mistake(
        "pixel_corner_mean",
        "projection.c",
        ("view.point[2] + principal[r]", "view.point[2] + principal[r] - (real)0.5"),
    ),
    mistake(
        "pose_inverted",
        "projection.c",
        ("lens.w[k / 3][k % 3] = w[k];", "lens.w[k / 3][k % 3] = w[k % 3 * 3 + k / 3];"),
        ("lens.d[k] = d[k];", "lens.d[k] = -(w[k] * d[0] + w[3 + k] * d[1] + w[6 + k] * d[2]);"),
    ),
    mistake(
        "shape_rotation_ignored",
        "projection.c",
        (
            "lens->w[r][k] * rotation[(3 * k + c) * count]",
            "lens->w[r][k] * (real)(k == c) + 0 * rotation[(3 * k + c) * count]",
        ),
    ),
    mistake(
        "shape_not_turned_by_camera",
        "projection.c",
        ("lens->w[r][k] * rotation[(3 * k + c) * count]", "(real)(r == k) * rotation[(3 * k + c) * count]"),
    ),
    mistake("jacobian_without_depth_column", "projection.c", ("-lens->focal[r] * view->at[r] / (z * z);", "0;")),
    mistake(
        "jacobian_gradient_dropped",
        "projection.c",
        (
            "centre_reverse(&lens, &view, d_mean, d_depth[i], d_j, d_point);",
            "for (int r = 0; r < 6; r++)\n            d_j[r / 3][r % 3] = 0;\n        "
            "centre_reverse(&lens, &view, d_mean, d_depth[i], d_j, d_point);",
        ),
    ),
]
HARMONICS = [
    mistake("harmonics_sign_y", "harmonics.c", ("set(row[1], y, 0, 1, 0, -C1)", "set(row[1], y, 0, 1, 0, C1)")),
    mistake(
        "harmonics_x_and_y_swapped",
        "harmonics.c",
        ("set(row[1], y, 0, 1, 0, -C1)", "set(row[1], x, 1, 0, 0, -C1)"),
        ("set(row[3], x, 1, 0, 0, -C1)", "set(row[3], y, 0, 1, 0, -C1)"),
    ),
    mistake(
        "direction_inverted", "harmonics.c", ("position[k * n + i] - centre[k]", "centre[k] - position[k * n + i]")
    ),
    mistake("direction_gradient_dropped", "harmonics.c", ("(g[k] - along * v[k]) / norm", "0 * along")),
    mistake(
        "direction_gradient_not_projected", "harmonics.c", ("(g[k] - along * v[k]) / norm", "(g[k] - 0 * along) / norm")
    ),
    mistake(
        "colour_not_clamped",
        "harmonics.c",
        ("value >= 0 ? d_colour[c * n + i] : 0", "d_colour[c * n + i]"),
        ("fmax(value, (real)0)", "value"),
    ),
    mistake(
        "colour_clamp_gradient_passed", "harmonics.c", ("value >= 0 ? d_colour[c * n + i] : 0", "d_colour[c * n + i]")
    ),
    mistake("colour_clamped_above", "harmonics.c", ("fmax(value, (real)0)", "fmin(fmax(value, (real)0), (real)1)")),
    mistake("offset_half_missing", "harmonics.c", ("(real)0.5 + row[0][0] * residual", "row[0][0] * residual")),
    mistake(
        "residual_not_scaled",
        "harmonics.c",
        ("row[0][0] * residual[c * n + i]", "residual[c * n + i]"),
        ("row[0][0] * d_value;", "d_value;"),
    ),
    mistake(
        "direction_of_nothing",
        "harmonics.c",
        ("norm > 0 ? v[k] / norm : 0", "v[k] / norm"),
        ("norm > 0 ? (degree + 1) * (degree + 1) : 1", "(degree + 1) * (degree + 1)"),
    ),
]
RETURN = "return a->z != b->z ? (a->z > b->z) - (a->z < b->z) : (a->index > b->index) - (a->index < b->index);"
BY_INDEX = "(a->index > b->index) - (a->index < b->index)"
STOP = "        if (*left * (1 - alpha) < rules->stop)\n            break;\n"
HALF = "2.0 * big * big * m * sum[GA] + r * sum[GM]"
COMPOSITE = [
    mistake(
        "pixel_corner_sample",
        "composite.c",
        (
            "dx = (real)x + (real)0.5 - s->u, dy = (real)y + (real)0.5 - s->v",
            "dx = (real)x - s->u, dy = (real)y - s->v",
        ),
    ),
    mistake("order_by_index", "composite.c", (RETURN, f"return {BY_INDEX};")),
    mistake(
        "order_reversed", "composite.c", (RETURN, f"return a->z != b->z ? (a->z < b->z) - (a->z > b->z) : {BY_INDEX};")
    ),
    mistake(
        "ties_reversed",
        "composite.c",
        (RETURN, f"return a->z != b->z ? (a->z > b->z) - (a->z < b->z) : -({BY_INDEX});"),
    ),
    mistake(
        "depth_over_opacity",
        "composite.c",
        (
            "        for (int c = 0; c < 3; c++) {\n            colour[c * pixels + p] += left",
            "        if (opacity[p] > 0)\n            depth[p] /= opacity[p];\n        for (int c = "
            "0; c < 3; c++) {\n            colour[c * pixels + p] += left",
        ),
    ),
    mistake("background_missing", "composite.c", ("+= left * background[c]", "+= 0 * background[c]")),
    mistake("alpha_gradient_without_rest", "composite.c", ("(own[c] - behind[c])", "own[c]")),
    mistake(
        "alpha_gradient_without_background",
        "composite.c",
        ("{background[0], background[1], background[2], 0.0, 0.0}", "{0.0 * background[0], 0.0, 0.0, 0.0, 0.0}"),
    ),
    mistake("covariance_off_diagonal_half", "composite.c", (HALF, f"0.5 * ({HALF})")),
    mistake("depth_gradient_dropped", "composite.c", ("rules->drop_depth ? 0.0 :", "rules->drop_depth || 1 ? 0.0 :")),
    mistake(
        "opacity_gradient_without_sigmoid",
        "composite.c",
        ("hit->free_alpha * (1 - s->opacity) * d_alpha", "hit->free_alpha / s->opacity * d_alpha"),
    ),
    mistake("clamped_alpha_gradient", "composite.c", ("hit->free_alpha > rules->largest && !rules->pass_clamped", "0")),
    mistake(
        "clamp_blocks_legacy",
        "composite.c",
        ("hit->free_alpha > rules->largest && !rules->pass_clamped", "hit->free_alpha > rules->largest"),
    ),
    mistake("cutoff_missing", "composite.c", ("if (alpha < rules->cutoff)", "if (alpha < 0 * rules->cutoff)")),
    mistake(
        "cutoff_1_over_256", "composite.c", ("if (alpha < rules->cutoff)", "if (alpha < rules->cutoff * 255 / 256)")
    ),
    mistake(
        "alpha_clamp_999",
        "composite.c",
        (
            'rules.largest = (real)setting(request, "raster.alpha_max");',
            'rules.largest = (real)setting(request, "raster.alpha_max") < 1 ? (real)0.999 : 1;',
        ),
    ),
    mistake("alpha_clamp_missing", "composite.c", ("fmin(free_alpha, rules->largest)", "fmin(free_alpha, (real)1)")),
    mistake("stop_missing", "composite.c", (STOP, "")),
    mistake("stop_at_1e-3", "composite.c", ("< rules->stop)", "< 10 * rules->stop)")),
    mistake(
        "stop_after",
        "composite.c",
        (STOP, ""),
        (
            "        *left *= 1 - alpha;\n",
            "        *left *= 1 - alpha;\n        if (*left < rules->stop)\n            break;\n",
        ),
    ),
    mistake("stop_skips", "composite.c", (STOP, STOP.replace("break", "continue"))),
    mistake("tiles_from_the_mean", "composite.c", ("centre - (real)0.5", "centre")),
    mistake("tiles_root_without_floor", "composite.c", ("fmax((real)0.1, half", "fmax((real)0, half")),
    mistake("tiles_unbounded", "composite.c", ("if (!rules->tiles)", "if (!rules->tiles || 1)")),
]
MISTAKES = [*READING, *TIME, *LAPLACIAN, *PROJECTION, *HARMONICS, *COMPOSITE]
