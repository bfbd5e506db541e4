"""Wrong ports of the base losses (B6) to (B9)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.negative import Negative, Request, swapped

C1, C2 = 0.01**2, 0.03**2


def _share(loss: str):
    """Averaged over all pixels in place of tissue pixels."""

    def wrong(request: Request) -> dict[str, Any] | None:
        share = float(request.inputs["mask"].mean())
        if share in (0.0, 1.0):
            return None
        return {loss: request.right[loss] * share, "d_rendered": request.right["d_rendered"] * share}

    return wrong


def _times(factor: float, *names: str):
    return lambda request: {name: request.right[name] * factor for name in names}


def _inverted(request: Request) -> dict[str, NDArray] | None:
    mask = request.inputs["mask"]
    if not mask.any():
        return None
    return request.run(dict(request.inputs) | {"mask": ~mask}, request.settings)


def _window(radius: int) -> NDArray:
    k = np.arange(-radius, radius + 1)
    w = np.exp(-(k**2) / (2 * 1.5**2))
    return np.outer(w, w) / w.sum() ** 2


def _ssim(x: NDArray, y: NDArray, mask: NDArray, radius: int = 5, border: str = "constant") -> float:
    window = _window(radius)

    def blur(image: NDArray) -> NDArray:
        wide = np.pad(image, ((0, 0), (radius, radius), (radius, radius)), mode=border)  # type: ignore[call-overload]
        views = np.lib.stride_tricks.sliding_window_view(wide, window.shape, axis=(1, 2))
        return np.einsum("cyxab,ab->cyx", views, window)

    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx**2, blur(y * y) - my**2, blur(x * y) - mx * my
    similarity = (2 * mx * my + C1) * (2 * cov + C2) / ((mx**2 + my**2 + C1) * (vx + vy + C2))
    return float(similarity[:, mask].mean())


def _ssim_with(masked: bool = True, **switches: Any):
    def wrong(request: Request) -> dict[str, Any] | None:
        mask = request.inputs["mask"]
        if not mask.any():
            return None
        x, y = request.inputs["rendered"].astype(float), request.inputs["observed"].astype(float)
        if masked:
            x, y = np.where(mask, x, 0), np.where(mask, y, 0)
        return {"ssim": _ssim(x, y, mask, **switches)}

    return wrong


def _depth(request: Request, *, holes=False, constant=False, tissue_maximum=False, normalise=True, first=False,
           few=False) -> dict[str, Any]:  # fmt: skip
    depth, prior, mask = (request.inputs[n].astype(float) for n in ("rendered_depth", "prior_depth", "mask"))
    mask = mask > 0
    valid = mask if holes else mask & np.isfinite(prior) & (prior > 0)
    count = int(valid.sum())
    if count < 10 and not few:
        return {}
    inside = mask if tissue_maximum else np.ones(mask.shape, bool)
    top, top_prior = (a[inside & np.isfinite(a)].max() if normalise else 1.0 for a in (depth, prior))
    if top == 0:
        return {}
    residual = np.where(valid, depth / top - prior / top_prior, 0.0)
    up = float(request.inputs["d_loss"])
    gradient = up * np.sign(residual) / (count * top)
    if normalise and not constant:
        holders = (depth == top) & inside
        share = -up * (np.sign(residual) * np.where(valid, depth, 0.0)).sum() / (count * top**2)
        if first:
            gradient[tuple(np.argwhere(holders)[0])] += share
        else:
            gradient[holders] += share / holders.sum()
    return {"loss": np.abs(residual).sum() / count, "d_rendered_depth": gradient}


NEGATIVES = [
    Negative("l1_over_all_pixels", "L1 averaged over all pixels", "over H W; right: over tissue pixels",
             {"masked_l1": _share("loss")}),
    Negative("l1_sum_over_channels", "L1 summed over channels", "3 times too large; right: mean",
             {"masked_l1": _times(3.0, "loss", "d_rendered")}),
    Negative("mask_inverted_loss", "Loss over the instrument", "mask inverted; right: over tissue",
             {"masked_l1": _inverted, "masked_ssim": _inverted}),
    Negative("ssim_over_all_pixels", "SSIM averaged over all pixels", "over H W; right: over tissue pixels",
             {"masked_ssim": _share("ssim")}),
    Negative("ssim_of_unmasked_images", "SSIM map of the unmasked images",
             "reads what an instrument covers; right: both images 0 there", {"masked_ssim": _ssim_with(masked=False)}),
    Negative("ssim_window_7", "SSIM with a window of 7", "7 pixels; right: 11", {"masked_ssim": _ssim_with(radius=3)}),
    Negative("ssim_reflect_border", "SSIM with a mirrored border", "reflects; right: zeros",
             {"masked_ssim": _ssim_with(border="reflect")}),
    Negative("depth_holes_count", "Pixels without prior take part", "prior 0 as depth; right: excluded",
             {"normalised_depth": lambda r: _depth(r, holes=True)}),
    Negative("depth_maximum_constant", "Largest depth taken as constant", "no gradient to it; right: it has one",
             {"normalised_depth": lambda r: _depth(r, constant=True)}),
    Negative("depth_maximum_of_tissue", "Largest depth over tissue", "over tissue; right: over the whole image",
             {"normalised_depth": lambda r: _depth(r, tissue_maximum=True)}),
    Negative("depth_not_normalised", "Depths compared in scene units", "no division; right: each over its largest",
             {"normalised_depth": lambda r: _depth(r, normalise=False)}),
    Negative("depth_first_maximum", "First of equal maxima takes the gradient", "first; right: split evenly",
             {"normalised_depth": lambda r: _depth(r, first=True)}),
    Negative("depth_few_priors", "Depth loss of fewer than ten pixels", "evaluated; right: 0",
             {"normalised_depth": lambda r: _depth(r, few=True)}),
    Negative("edges_ignored", "Smoothing across edges", "all neighbours; right: not across an edge",
             {"smoothness": swapped(lambda i: {"edges": np.zeros_like(i["edges"])})}),
    Negative("variation_of_tissue", "Total variation of the tissue", "inside; right: of the excluded region",
             {"smoothness": lambda r: {n: v for n, v in r.run(
                 dict(r.inputs) | {"mask": ~r.inputs["mask"]}, r.settings).items() if n == "d_rendered"}}),
    Negative("smoothness_on_all_pixels", "Squared steps on all pixels", "mask ignored; right: tissue only",
             {"smoothness": lambda r: {"d_rendered_depth": r.run(
                 dict(r.inputs) | {"mask": np.ones_like(r.inputs["mask"])}, r.settings)["d_rendered_depth"]}}),
]  # fmt: skip
