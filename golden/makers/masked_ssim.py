"""Family `masked_ssim`: the masked SSIM (B7), a mean of the similarity map over tissue pixels.

A rendered and an observed image and a tissue mask come in. The cases repeat those of `masked_l1`; the mistakes concern
the window, its border, and whether the images are set to 0 outside tissue before they are filtered.
"""

from makers.images import masked_mean
from makers.making import Spec
from makers.wrong import edit, port

OPERATIONS = ("masked_ssim",)


def cases() -> list[Spec]:
    """The cases of `masked_l1`."""
    return masked_mean(
        "masked_ssim",
        "d_ssim",
        generic=("ssim_over_all_pixels", "ssim_of_unmasked_images", "ssim_window_7", "ssim_reflect_border",
                 "mask_inverted_loss", "ssim_box_window", "ssim_window_renormalised"),
        one_pixel_only=("ssim_over_all_pixels",),
        equal=(),
    )  # fmt: skip


# ---- mistakes ----

SOURCE = "losses.masked_ssim"
REFLECTED = (
    edit(
        SOURCE,
        "    parallel_for(\n        _similarity_kernel, totals",
        "    for padded in (difference, total):\n"
        "        inside = padded[:, RADIUS:-RADIUS, RADIUS:-RADIUS].copy()\n"
        '        padded[:] = np.pad(inside, ((0, 0), (RADIUS, RADIUS), (RADIUS, RADIUS)), mode="reflect")\n'
        "    parallel_for(\n        _similarity_kernel, totals",
    ),
    edit(
        SOURCE,
        "    rows = target.image.shape[0] * target.image.shape[1]\n",
        """
    w, (e, s, slopes) = window(d_rendered.dtype), saved[:3]
    wide = np.pad(slopes, ((0, 0), (0, 0), (RADIUS, RADIUS), (RADIUS, RADIUS)))
    smooth = sum(w[j] * wide[:, :, j : j + e.shape[1]] for j in range(TAPS))
    smooth = sum(w[k] * smooth[..., k : k + e.shape[2]] for k in range(TAPS))
    everywhere = scale * (smooth[0] + 2 * (e * smooth[1] + s * smooth[2]))
    rows, columns = (np.pad(np.arange(n), RADIUS, mode="reflect") for n in target.mask.shape)
    d_rendered[:] = 0
    np.add.at(d_rendered, (slice(None), rows[:, None], columns), everywhere)
    return np.where(target.mask, d_rendered, 0)
    rows = target.image.shape[0] * target.image.shape[1]
""",
    ),
)
RENORMALISED = (
    edit(
        SOURCE,
        "def _similarity(first",
        """def _inside(weights, place, size):
    taps = np.arange(place - RADIUS, place + RADIUS + 1)
    kept = np.where((taps >= 0) & (taps < size), weights, 0 * weights)
    return kept / kept.sum(), kept.sum()


def _similarity(first""",
    ),
    edit(
        SOURCE,
        "_column_moments(difference[channel, y : y + TAPS], weights,",
        "down, share = _inside(weights, y, height)\n        _column_moments(difference[channel, y : y + TAPS], down,",
    ),
    edit(
        SOURCE,
        "_column_moments(total[channel, y : y + TAPS], weights,",
        "_column_moments(total[channel, y : y + TAPS], down,",
    ),
    edit(
        SOURCE,
        "        centre = column_mean[i + RADIUS]\n",
        "        centre, own = column_mean[i + RADIUS], _inside(weights, i, mean.size)[0]\n",
    ),
    edit(
        SOURCE,
        "first += weights[k] * deviation\n            second += weights[k] * (column",
        "first += own[k] * deviation\n            second += own[k] * (column",
    ),
    edit(
        SOURCE,
        "            dissimilarity[i] = p_loss",
        "            part = share * _inside(weights, i, width)[1]\n            dissimilarity[i] = p_loss",
    ),
    edit(
        SOURCE,
        "slope_1[i] = a - two * (b * mean_e[i] + c * mean_s[i]) if",
        "slope_1[i] = (a - two * (b * mean_e[i] + c * mean_s[i])) / part if",
    ),
    edit(SOURCE, "slope_e[i] = b if", "slope_e[i] = b / part if"),
    edit(SOURCE, "slope_s[i] = c if", "slope_s[i] = c / part if"),
)

WRONG_PORTS = [
    port(
        "ssim_over_all_pixels",
        "SSIM averaged over all pixels",
        "whole map over H W; right: over tissue pixels",
        "masked_ssim",
        edit(SOURCE, "observed.shape[0] * int(np.count_nonzero(mask))", "observed.size"),
        edit(SOURCE, "p_loss + p * q_loss if tissue[i] else zero", "p_loss + p * q_loss"),
        edit(SOURCE, "c * mean_s[i]) if tissue[i] else zero", "c * mean_s[i])"),
        edit(SOURCE, "slope_e[i] = b if tissue[i] else zero", "slope_e[i] = b"),
        edit(SOURCE, "slope_s[i] = c if tissue[i] else zero", "slope_s[i] = c"),
    ),
    port(
        "ssim_of_unmasked_images",
        "SSIM map of the unmasked images",
        "reads what an instrument covers; right: both images 0 there",
        "masked_ssim",
        edit(SOURCE, "np.where(mask, observed, observed.dtype.type(0))", "observed"),
        edit(SOURCE, "seen[i] - wanted[i] if tissue[i] else zero", "seen[i] - wanted[i]"),
        edit(SOURCE, "seen[i] + wanted[i] if tissue[i] else zero", "seen[i] + wanted[i]"),
        edit(SOURCE, "out[i] = slope if tissue[i] else zero", "out[i] = slope"),
    ),
    port(
        "ssim_window_7",
        "SSIM with a window of 7",
        "7 pixels; right: 11",
        "masked_ssim",
        edit(SOURCE, "RADIUS = 5", "RADIUS = 3"),
    ),
    port(
        "ssim_box_window",
        "SSIM with a box window",
        "equal weights; right: a Gaussian of sigma 1.5",
        "masked_ssim",
        edit(SOURCE, "weights = np.exp(-(offset**2) / (2 * WINDOW_SIGMA**2))", "weights = np.ones(TAPS)"),
    ),
    port("ssim_reflect_border", "SSIM with a mirrored border", "reflects; right: zeros", "masked_ssim", *REFLECTED),
    port(
        "ssim_window_renormalised",
        "SSIM window renormalised at the border",
        "weights inside the image sum to 1; right: zeros outside",
        "masked_ssim",
        *RENORMALISED,
    ),
]
