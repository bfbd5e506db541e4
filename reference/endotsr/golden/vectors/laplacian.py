"""Family `laplacian`: equation (5), the pyramid of the observed image, its valid pixels and the Laplacian loss.

A rendered and an observed image, a tissue mask and an up-sampling rule come in. The cases are odd, even and tiny sizes,
a level without valid pixels, an image without tissue, equal images, and numbers under the mask that are not finite.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.images import spoiled, tissue
from endotsr.golden.vectors.making import Made, Seeds, Spec, given, scalar
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort, setting

OPERATIONS = ("laplacian",)


def _images(case: str, shape: tuple[int, int]) -> dict[str, Made]:
    seeds = Seeds("laplacian", case)
    return {name: seeds.uniform(name, 0.0, 1.0, 3, *shape, unit="display") for name in ("rendered", "observed")}


def _generic() -> list[Spec]:
    loss_flags = ("mask_before_pyramid", "pyramid_zero_border", "laplacian_over_all_pixels", "upsampling_swapped",
                  "upsampling_nearest", "levels_not_averaged")  # fmt: skip
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


# ---- mistakes: equation (5) by dense matrices, with switches ----


def _filter(n: int, border: str) -> NDArray:
    out = np.zeros(((n + 1) // 2, n))
    for row in range(out.shape[0]):
        for tap, weight in zip(range(-2, 3), (1, 4, 6, 4, 1)):
            k = 2 * row + tap
            if border == "mirror":
                period = max(2 * (n - 1), 1)
                k = abs(k) % period
                k = min(k, period - k) if n > 1 else 0
            if 0 <= k < n:
                out[row, k] += weight / 16
    return out


def _expand(n: int, rule: str) -> NDArray:
    m = (n + 1) // 2
    fine = {"co_sited": np.arange(n) / 2, "half_pixel": (np.arange(n) + 0.5) / 2 - 0.5}.get(rule, np.arange(n) // 2)
    return np.stack([np.interp(fine, np.arange(m), row) for row in np.eye(m)], axis=1)


def _laplacian_with(request: Request, *, border="mirror", rule=None, masks="support", divide="valid",
                   levels_mean=True, rescale=False) -> dict[str, Any]:  # fmt: skip
    """Equation (5) by dense matrices, one thing different."""
    rule = rule or request.settings["upsampling"]
    mask = request.inputs["mask"]
    difference = np.where(mask, request.inputs["rendered"] - request.inputs["observed"], 0.0)
    observed = request.inputs["observed"].astype(float)
    up = float(request.inputs["d_loss"])
    height, width = mask.shape
    down_y, down_x = np.eye(height), np.eye(width)
    out: dict[str, Any] = {}
    parts, gradients = [], []
    shrunk = mask
    for level in range(request.settings["levels"]):
        h, w = down_y.shape[0], down_x.shape[0]
        ry, rx, ey, ex = _filter(h, border), _filter(w, border), _expand(h, rule), _expand(w, rule)
        next_y, next_x = ry @ down_y, rx @ down_x

        smooth_y, smooth_x = ey @ next_y, ex @ next_x
        band_of = [down_y @ i @ down_x.T - smooth_y @ i @ smooth_x.T for i in (difference, observed)]
        valid = request.right[f"valid_{level + 1}"] if masks == "support" else shrunk
        sign = np.sign(band_of[0]) * valid
        count = 3 * (valid.sum() if divide == "valid" else valid.size)
        parts.append(np.abs(band_of[0] * valid).sum() / count if count else None)
        g = down_y.T @ sign @ down_x - smooth_y.T @ sign @ smooth_x
        gradients.append(g / max(count, 1))
        out[f"band_{level + 1}"], out[f"valid_{level + 1}"] = band_of[1], valid
        down_y, down_x, shrunk = next_y, next_x, shrunk[::2, ::2]
    present = [p for p in parts if p is not None]
    fraction = 1.0 if not levels_mean else 1.0 / (len(present) if rescale and present else len(parts))
    out["loss"] = fraction * sum(present)
    out["d_rendered"] = np.where(mask, up * fraction * sum(gradients), 0.0)
    return out


def _by_matrices(**switches: Any) -> dict[str, Wrong]:
    return {"laplacian": lambda request: _laplacian_with(request, **switches)}


WRONG_PORTS = [
    WrongPort("mask_before_pyramid", "Mask applied to the images instead of the support",
              "all band pixels under the subsampled mask; right: those whose whole footprint is tissue",
              _by_matrices(masks="image")),
    WrongPort("pyramid_zero_border", "Zero border in the binomial filter", "zeros outside; right: reflect-101",
              _by_matrices(border="zero")),
    WrongPort("laplacian_over_all_pixels", "Detail loss averaged over all band pixels", "over all; right: valid ones",
              _by_matrices(divide="all")),
    WrongPort("upsampling_swapped", "The other up-sampling rule", "half-pixel for co-sited or back",
              {"laplacian": lambda r: _laplacian_with(r, rule="half_pixel" if r.settings["upsampling"] == "co_sited"
                                                     else "co_sited"),
               "objective": setting(loss__upsampling=lambda old: "half_pixel" if old == "co_sited" else "co_sited")}),
    WrongPort("upsampling_nearest", "Nearest-neighbour up-sampling", "repeats samples; right: linear interpolation",
              _by_matrices(rule="nearest")),
    WrongPort("levels_not_averaged", "Levels added, not averaged", "sum; right: 1/3 of it",
              _by_matrices(levels_mean=False)),
    WrongPort("empty_level_rescaled", "Average over the levels that are not empty", "1/2; right: the 1/3 stays",
              {"laplacian": lambda r: _laplacian_with(r, rescale=True),
               "objective": lambda r: setting(loss__lambda_lap=lambda old: old * 1.5)(r)
               if r.inputs["mask"].mean() < 0.8 else None}),
]  # fmt: skip
