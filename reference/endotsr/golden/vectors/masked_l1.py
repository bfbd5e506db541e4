"""Family `masked_l1`: the masked L1 (B6), and the mistakes that every mean over tissue pixels can make.

A rendered and an observed image and a tissue mask come in. The cases are an instrument, one pixel of tissue, no tissue,
equal images, and numbers under the mask that are not finite: excluded values must never be read.
"""

from endotsr.golden.vectors.images import (
    inverted_mask,
    masked_mean,
    multiplied,
    nan_without_tissue,
    over_all_pixels,
    sign_of_zero,
)
from endotsr.golden.vectors.making import Spec
from endotsr.golden.vectors.wrong import WrongPort, scaled

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

WRONG_PORTS = [
    WrongPort("l1_over_all_pixels", "L1 averaged over all pixels", "over H W; right: over tissue pixels",
              {"masked_l1": over_all_pixels("loss")}),
    WrongPort("l1_sum_over_channels", "L1 summed over channels", "3 times too large; right: mean",
              {"masked_l1": scaled(3.0, "loss", "d_rendered")}),
    WrongPort("mask_inverted_loss", "Loss over the instrument", "mask inverted; right: over tissue",
              {"masked_l1": inverted_mask, "masked_ssim": inverted_mask}),
    WrongPort("mean_of_nothing", "Mean over no pixels", "0 / 0; right: a defined value",
              {"laplacian": nan_without_tissue("loss", "d_rendered"),
               "masked_l1": nan_without_tissue("loss", "d_rendered"),
               "masked_ssim": nan_without_tissue("ssim", "d_rendered")}),
    WrongPort("sign_of_zero", "sign(0) = 1", "a pull between equal images; right: none",
              {"laplacian": sign_of_zero, "masked_l1": sign_of_zero}),
    WrongPort("mask_multiplied", "Mask multiplied, not selected", "0 times NaN; right: excluded values are not read",
              {"masked_l1": multiplied("rendered", "observed", "loss"),
               "masked_ssim": multiplied("rendered", "observed", "ssim"),
               "laplacian": multiplied("rendered", "observed", "loss"),
               "normalised_depth": multiplied("rendered_depth", "prior_depth", "loss")}),
]  # fmt: skip
