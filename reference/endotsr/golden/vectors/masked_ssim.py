"""Family `masked_ssim`: the masked SSIM (B7), a mean of the similarity map over tissue pixels.

A rendered and an observed image and a tissue mask come in. The cases repeat those of `masked_l1`; the mistakes concern
the window, its border, and whether the images are set to 0 outside tissue before they are filtered.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.images import (
    masked_mean,
    over_all_pixels,
)
from endotsr.golden.vectors.making import Spec
from endotsr.golden.vectors.wrong import Request, WrongPort

OPERATIONS = ("masked_ssim",)


def cases() -> list[Spec]:
    """The cases of `masked_l1`."""
    return masked_mean(
        "masked_ssim",
        "d_ssim",
        generic=("ssim_over_all_pixels", "ssim_of_unmasked_images", "ssim_window_7", "ssim_reflect_border",
                 "mask_inverted_loss"),
        one_pixel_only=("ssim_over_all_pixels",),
        equal=(),
    )  # fmt: skip


# ---- mistakes: the similarity map written out, with switches ----

C1, C2 = 0.01**2, 0.03**2


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


WRONG_PORTS = [
    WrongPort("ssim_over_all_pixels", "SSIM averaged over all pixels", "over H W; right: over tissue pixels",
              {"masked_ssim": over_all_pixels("ssim")}),
    WrongPort("ssim_of_unmasked_images", "SSIM map of the unmasked images",
              "reads what an instrument covers; right: both images 0 there", {"masked_ssim": _ssim_with(masked=False)}),
    WrongPort("ssim_window_7", "SSIM with a window of 7", "7 pixels; right: 11", {"masked_ssim": _ssim_with(radius=3)}),
    WrongPort("ssim_reflect_border", "SSIM with a mirrored border", "reflects; right: zeros",
              {"masked_ssim": _ssim_with(border="reflect")}),
]  # fmt: skip
