"""Family `masked_ssim`: the masked SSIM (B7), a mean of the similarity map over tissue pixels.

Inputs: a rendered and an observed image and a tissue mask. The cases are those of `masked_l1`; the mistakes concern the
window, its border, and images that are not set to 0 outside tissue before filtering.
"""

from makers.images import masked_mean
from makers.making import Spec
from makers.operations import PER_DISPLAY, Declared, Judged

TEXTBOOK = 2e-4  # E[x^2] - E[x]^2 in float32 over C2 = 9e-4: the usual form of SSIM loses this much
DECLARED = {
    "masked_ssim": Declared(
        {
            "ssim": Judged(1, oracle="masked_ssim.masked_ssim_forward", least32=TEXTBOOK),
            "d_rendered": Judged(2, PER_DISPLAY, oracle="masked_ssim.masked_ssim_reverse", least32=TEXTBOOK),
        },
        "`d_ssim` is the given derivative",
    )
}
OPERATIONS = tuple(DECLARED)


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
