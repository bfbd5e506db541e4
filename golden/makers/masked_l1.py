"""Family `masked_l1`: the masked L1 (B6), and the mistakes that every mean over tissue pixels can make.

A rendered and an observed image and a tissue mask come in. The cases are an instrument, one pixel of tissue, no tissue,
equal images, and numbers under the mask that are not finite: excluded values must never be read.
"""

from makers.images import masked_mean
from makers.making import Spec
from makers.wrong import edit, port

OPERATIONS = ("masked_l1",)


def cases() -> list[Spec]:
    """Masks, equal images, numbers that are not finite."""
    return masked_mean(
        "masked_l1",
        "d_loss",
        generic=("l1_over_all_pixels", "l1_sum_over_channels", "mask_inverted_loss"),
        one_pixel_only=("l1_over_all_pixels",),
        equal=("sign_of_zero",),
    )


# ---- mistakes ----

SOURCE, SSIM, LAPLACIAN, DEPTH = "losses.masked_l1", "losses.masked_ssim", "equations.laplacian", "losses.depth"
COUNT = "rendered.shape[0] * int(np.count_nonzero(mask))"

WRONG_PORTS = [
    port(
        "l1_over_all_pixels",
        "L1 averaged over all pixels",
        "over H W; right: over tissue pixels",
        "masked_l1",
        edit(SOURCE, COUNT, "rendered.size"),
    ),
    port(
        "l1_sum_over_channels",
        "L1 summed over channels",
        "3 times too large; right: mean",
        "masked_l1",
        edit(SOURCE, COUNT, "int(np.count_nonzero(mask))"),
    ),
    port(
        "mask_inverted_loss",
        "Loss over the instrument",
        "mask inverted; right: over tissue",
        "masked_l1 masked_ssim",
        edit(SOURCE, "mask = np.ascontiguousarray(mask)", "mask = np.ascontiguousarray(~mask)"),
        edit(
            SSIM,
            '    observed = check_image("observed", observed, mask)\n    image',
            '    mask = ~mask\n    observed = check_image("observed", observed, mask)\n    image',
        ),
    ),
    port(
        "mean_of_nothing",
        "Mean over no pixels",
        "0 / 0; right: a defined value",
        "laplacian masked_l1 masked_ssim",
        edit(LAPLACIAN, "count) if count else 0.0", "count) if count else np.nan"),
        edit(SOURCE, "return 0.0, saved", "return np.nan, saved"),
        edit(SOURCE, "return np.zeros_like(saved.rendered)", "return np.full_like(saved.rendered, np.nan)"),
        edit(SSIM, "return 1.0, saved", "return np.nan, saved"),
        edit(
            SSIM,
            "return np.zeros(target.image.shape, saved.difference.dtype)",
            "return np.full(target.image.shape, np.nan, saved.difference.dtype)",
        ),
    ),
    port(
        "sign_of_zero",
        "sign(0) = 1",
        "a pull between equal images; right: none",
        "laplacian masked_l1",
        edit(
            LAPLACIAN,
            "sign[x] = np.int8(band > real(0.0)) - np.int8(band < real(0.0))",
            "sign[x] = (1 if band >= real(0.0) else -1) if keep[x] else 0",
        ),
        edit(SOURCE, "slope = step if difference > zero", "slope = step if difference >= zero"),
    ),
    port(
        "mask_multiplied",
        "Mask multiplied, not selected",
        "0 times NaN; right: excluded values are not read",
        "masked_l1 masked_ssim laplacian normalised_depth",
        edit(SOURCE, "abs(seen[i] - wanted[i]) if tissue[i] else zero", "abs(seen[i] - wanted[i]) * tissue[i]"),
        edit(SSIM, "np.where(mask, observed, observed.dtype.type(0))", "observed * mask"),
        edit(SSIM, "seen[i] - wanted[i] if tissue[i] else zero", "seen[i] * tissue[i] - wanted[i]"),
        edit(SSIM, "seen[i] + wanted[i] if tissue[i] else zero", "seen[i] * tissue[i] + wanted[i]"),
        edit(
            LAPLACIAN,
            "target[x] = d if keep[x] else real(0.0)\n\n\ndef _band",
            "target[x] = d * real(keep[x])\n\n\ndef _band",
        ),
        edit(LAPLACIAN, "band = band if keep[x] else real(0.0)", "band = band * real(keep[x])"),
        edit(DEPTH, "abs(residual) if use[i] else zero", "abs(residual) * use[i]"),
    ),
]
