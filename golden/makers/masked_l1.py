"""Family `masked_l1`: the masked L1 (B6), and the mistakes common to all means over tissue pixels.

Inputs: a rendered and an observed image and a tissue mask. The cases are an instrument, one pixel of tissue, no tissue,
equal images, and non-finite numbers under the mask: excluded values must have no effect.
"""

from makers.images import masked_mean
from makers.making import Spec
from makers.operations import PER_DISPLAY, Declared, Judged

DECLARED = {
    "masked_l1": Declared(
        {
            "loss": Judged(1, "display", oracle="masked_l1.masked_l1_forward"),
            "d_rendered": Judged(2, PER_DISPLAY),
        },
        "`d_loss` is the given derivative",
    )
}
OPERATIONS = tuple(DECLARED)


def cases() -> list[Spec]:
    """Masks, equal images, non-finite numbers."""
    return masked_mean(
        "masked_l1",
        "d_loss",
        generic=("l1_over_all_pixels", "l1_sum_over_channels", "mask_inverted_loss"),
        one_pixel_only=("l1_over_all_pixels",),
        equal=("sign_of_zero",),
    )
