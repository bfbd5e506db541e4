"""Family `masked_l1`: the masked L1 (B6), and the mistakes that every mean over tissue pixels can make.

A rendered and an observed image and a tissue mask come in. The cases are an instrument, one pixel of tissue, no tissue,
equal images, and numbers under the mask that are not finite: excluded values must never be read.
"""

from makers.images import masked_mean
from makers.making import Spec

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
