"""Family `laplacian`: equation (5), the pyramid of the observed image, its valid pixels and the Laplacian loss.

A rendered and an observed image, a tissue mask and an up-sampling rule come in. The cases are odd, even and tiny sizes,
a level without valid pixels, an image without tissue, equal images, and numbers under the mask that are not finite.
"""

import numpy as np

from makers.copies import Edit
from makers.images import spoiled, tissue
from makers.making import Made, Seeds, Spec, given, scalar
from makers.wrong import edit, port

OPERATIONS = ("laplacian",)


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
    """Sizes, empty levels, equal images, numbers that are not finite."""
    return [*_generic(), _equal(), _not_finite()]


# ---- mistakes ----

SOURCE, PYRAMID = "equations.laplacian", "equations.pyramid"
LOSS, WHOLE = "laplacian", "laplacian objective"
ZERO_BORDER = (
    *(
        edit(
            PYRAMID,
            f"{name} = fine[reflect({row}, h)]\n",
            f"{name} = fine[max(min({row}, h - 1), 0)] * real(0 <= {row} < h)\n",
        )
        for name, row in (("a", "2 * y - 2"), ("b", "2 * y - 1"), ("d", "2 * y + 1"), ("e", "2 * y + 2"))
    ),
    edit(
        PYRAMID,
        "padded[0] = inside[reflect(-2, w)]\n    padded[1] = inside[reflect(-1, w)]",
        "padded[0] = real(0.0)\n    padded[1] = real(0.0)",
    ),
    edit(PYRAMID, "inside[x] = inside[reflect(x, w)]", "inside[x] = real(0.0)"),
    edit(PYRAMID, "    inside[reflect(-2, w)] += padded[0]\n    inside[reflect(-1, w)] += padded[1]\n", ""),
    edit(PYRAMID, "inside[reflect(x, w)] += inside[x]", "inside[x] += real(0.0)"),
    edit(
        PYRAMID,
        "entries[key] = entries.get(key, 0.0) + tap",
        "entries[key] = entries.get(key, 0.0) + tap * (0 <= 2 * k + offset < n)",
    ),
)


def _weights(co_sited: str, half_pixel: str) -> Edit:
    return edit(
        PYRAMID,
        '{"co_sited": (1.0, 0.5), "half_pixel": (0.75, 0.75)}',
        f'{{"co_sited": {co_sited}, "half_pixel": {half_pixel}}}',
    )


def _count(new: str) -> Edit:
    return edit(SOURCE, "1.0 / (len(masks.bands) * channels * count) if count else 0.0", new)


WRONG_PORTS = [
    port(
        "mask_before_pyramid",
        "Mask applied to the images instead of the support",
        "all band pixels under the subsampled mask; right: those whose whole footprint is tissue",
        LOSS,
        edit(SOURCE, "coarse = _reduce_support(valid)", "coarse = valid[::2, ::2]"),
        edit(SOURCE, "valid & _expand_support(coarse, valid.shape, upsampling)", "valid"),
    ),
    port(
        "support_subsampled",
        "Mask subsampled instead of eroded",
        "the even pixels of the mask; right: all pixels that the filter reads",
        LOSS,
        edit(SOURCE, "coarse = _reduce_support(valid)", "coarse = valid[::2, ::2]"),
    ),
    port(
        "support_not_expanded",
        "Support of a band from its own level alone",
        "the reduced mask; right: and the coarse samples that the up-sampling reads",
        LOSS,
        edit(SOURCE, "valid & _expand_support(coarse, valid.shape, upsampling)", "valid"),
    ),
    port(
        "pyramid_zero_border",
        "Zero border in the binomial filter",
        "zeros outside; right: reflect-101",
        LOSS,
        *ZERO_BORDER,
    ),
    port(
        "pyramid_replicated_border",
        "Replicated border in the binomial filter",
        "edge repeated; right: reflect-101",
        LOSS,
        edit(PYRAMID, "    if n == 1:\n        return 0\n    period", "    return min(max(i, 0), n - 1)\n    period"),
    ),
    port(
        "laplacian_over_all_pixels",
        "Detail loss averaged over all band pixels",
        "over all; right: valid ones",
        LOSS,
        _count("1.0 / (len(masks.bands) * channels * valid.size)"),
    ),
    port(
        "upsampling_swapped",
        "The other up-sampling rule",
        "half-pixel for co-sited or back",
        WHOLE,
        _weights("(0.75, 0.75)", "(1.0, 0.5)"),
    ),
    port(
        "upsampling_nearest",
        "Nearest-neighbour up-sampling",
        "repeats samples; right: linear interpolation",
        LOSS,
        _weights("(1.0, 1.0)", "(1.0, 1.0)"),
    ),
    port(
        "levels_not_averaged",
        "Levels added, not averaged",
        "sum; right: 1/3 of it",
        LOSS,
        _count("1.0 / (channels * count) if count else 0.0"),
    ),
    port(
        "empty_level_rescaled",
        "Average over the levels that are not empty",
        "1/2; right: the 1/3 stays",
        WHOLE,
        _count("1.0 / (sum(n > 0 for n in masks.counts) * channels * count) if count else 0.0"),
    ),
]
