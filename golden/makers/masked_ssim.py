"""Family `masked_ssim`: the masked SSIM (B7), a mean of the similarity map over tissue pixels.

Inputs: a rendered and an observed image and a tissue mask. The cases are those of `masked_l1`; the mistakes concern the
window, its border, and images that are not set to 0 outside tissue before filtering.
"""

from makers.images import masked_mean
from makers.making import Spec

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
