"""Family `laplacian`: equation (5), the pyramid of the observed image, its valid pixels and the Laplacian loss.

Inputs: a rendered and an observed image, a tissue mask and an up-sampling rule. The cases are odd, even and tiny sizes,
a level without valid pixels, an image without tissue, equal images, and non-finite numbers under the mask.
"""

import numpy as np

from endotsr.port.operations.laplacian import LEVELS
from makers.images import spoiled, tissue
from makers.making import Made, Seeds, Spec, given, scalar
from makers.operations import PER_DISPLAY, Declared, Judged

DECLARED = {
    "laplacian": Declared(
        {
            **{f"band_{j}": Judged(1, "display", oracle="laplacian.laplacian_levels") for j in range(1, LEVELS + 1)},
            **{f"valid_{j}": Judged(1, scale="exact", oracle="laplacian.support_masks") for j in range(1, LEVELS + 1)},
            "loss": Judged(1, "display", oracle="laplacian.laplacian_loss_forward"),
            "d_rendered": Judged(2, PER_DISPLAY, oracle="laplacian.laplacian_loss_reverse"),
        },
        "`band_j` = Laplacian bands of `observed`, without mask; `valid_j` = valid pixels of `mask`; loss of `rendered`"
        " against `observed`",
        settings={"upsampling": "loss.upsampling"},
    )
}
OPERATIONS = tuple(DECLARED)


def _images(case: str, shape: tuple[int, int]) -> dict[str, Made]:
    seeds = Seeds("laplacian", case)
    return {name: seeds.uniform(name, 0.0, 1.0, 3, *shape, unit="display") for name in ("rendered", "observed")}


def _generic() -> list[Spec]:
    loss_flags = ("mask_before_pyramid", "pyramid_zero_border", "laplacian_over_all_pixels", "upsampling_swapped",
                  "upsampling_nearest", "levels_not_averaged", "support_not_expanded", "support_subsampled",
                  "pyramid_replicated_border")  # fmt: skip
    rows = [
        ("co_sited", "co_sited", (19, 22), tissue(19, 22, 2, 3), "Odd and even sizes, co-sited", loss_flags),
        ("half_pixel", "half_pixel", (19, 22), tissue(19, 22, 2, 3), "Odd and even sizes, half-pixel", loss_flags),
        ("empty_level", "co_sited", (14, 17), tissue(14, 17, 9, 9), "The mask leaves no valid pixel at level 3: it "
         "adds 0 and the third stays", ("empty_level_rescaled", "mask_before_pyramid")),
        ("no_tissue", "co_sited", (9, 8), given(np.zeros((9, 8), bool), "all False"), "No tissue: 0, not NaN",
         ("mean_of_nothing",)),
        ("tiny", "half_pixel", (2, 3), given(np.ones((2, 3), bool), "all True"), "An image smaller than the filter",
         ("pyramid_zero_border",)),
    ]  # fmt: skip
    out = []
    for case, rule, shape, mask, title, flags in rows:
        inputs = _images(case, shape) | {"mask": mask, "d_loss": scalar(0.75)}
        out.append(Spec("laplacian", case, "laplacian", title, flags, {"upsampling": rule, "levels": 3}, inputs))
    return out


def _equal() -> Spec:
    image = _images("equal", (8, 9))["observed"]
    inputs = {"rendered": image, "observed": image, "mask": tissue(8, 9, 1, 2), "d_loss": scalar(1.0)}
    return Spec("laplacian", "equal", "laplacian", "Equal images: loss and gradient exactly 0", ("sign_of_zero",),
                {"upsampling": "co_sited", "levels": 3}, inputs, ("rendered", "observed"))  # fmt: skip


def _not_finite() -> Spec:
    case, mask = "not_finite_under_mask", tissue(19, 22, 2, 3)
    images = {name: spoiled(made, mask) for name, made in _images(case, (19, 22)).items()}
    return Spec("laplacian", case, "laplacian", "NaN and infinity under the mask change nothing", ("mask_multiplied",),
                {"upsampling": "co_sited", "levels": 3}, images | {"mask": mask, "d_loss": scalar(0.75)},
                without=("band_1", "band_2", "band_3"))  # fmt: skip


def cases() -> list[Spec]:
    """Sizes, empty levels, equal images, non-finite numbers."""
    return [*_generic(), _equal(), _not_finite()]
