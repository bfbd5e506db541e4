"""Three failing pictures beside ours.

The usual formula is above and endotsr below, both in float32 on the same input; a value that is not a number is
magenta. The formulas are those of the gallery, evaluated at every pixel.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.method.losses.masked_ssim import masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.method.splatting.projection import footprint
from endotsr.results.report.figures import colour_mapped
from endotsr.results.report.style import SMALL, name_axes, new_figure
from pages.hard_cases.gallery.rasteriser import by_division, needle, weight_gradient

F32 = np.float32
SIDE = 40  # pixels
LENGTH, FAR = 10_000, 3_500  # px: semi-axis of the needle; along both axes from its middle to that of the picture
OPAQUE_SIGMA = 5e4  # px: its alpha is exactly 1 in float32 within some 15 px of its centre
Pair = tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]


def pixels() -> Pair:
    """Offsets (H, W) of the pixels from the middle of the picture."""
    rows, columns = np.mgrid[:SIDE, :SIDE].astype(F32)
    return columns - F32(SIDE / 2), rows - F32(SIDE / 2)


def needle_opacity() -> Pair:
    """Opacity of a needle at 45 degrees, far from its middle: textbook distance, skipped where negative; and ours."""
    out, _, _ = needle(F32, LENGTH)
    a, b, c = out.covariance2d[:, 0]
    along, slope, across = footprint(out)[:, 0]
    dx, dy = (offset + F32(FAR) for offset in pixels())
    textbook = (c * dx * dx - F32(2) * b * dx * dy + a * dy * dy) / out.determinant[0]
    eta = dx - slope * dy
    ours = across * dy * dy + along * eta * eta
    drawn = [np.where(q < 0, F32(0), np.exp(-q / F32(2))) for q in (textbook, ours)]
    return drawn[0], drawn[1]


def opaque_gradient() -> Pair:
    """Gradient of the red of every pixel with respect to the alpha of a red Gaussian in front of an opaque one."""
    dx, dy = pixels()
    opaque = np.exp(-(dx**2 + dy**2) / F32(2 * OPAQUE_SIGMA**2)).astype(F32)
    found = np.empty((2, SIDE, SIDE), F32)
    for index in np.ndindex(SIDE, SIDE):
        alphas = [0.3, float(opaque[index]), 0.5]
        found[0][index] = by_division(alphas, F32)
        found[1][index] = weight_gradient(alphas, F32)
    return found[0], found[1]


def unknown_under_the_instrument() -> Pair:
    """Size of the gradient of SSIM, where the frame is not a number under the instrument.

    Above, frame and render are multiplied by the mask; below, the masked pixels are selected.
    """
    random = np.random.default_rng(3)
    rendered, observed = random.uniform(0.2, 0.8, (2, 3, SIDE, SIDE)).astype(F32)
    tissue = np.ones((SIDE, SIDE), bool)
    tissue[14:26, 16:] = False
    observed[:, ~tissue] = np.nan
    found = []
    for picture, frame, mask in (
        (rendered * tissue, observed * tissue, np.ones_like(tissue)),
        (rendered, observed, tissue),
    ):
        _, saved = masked_ssim_forward(picture, ssim_target(frame, mask))
        found.append(np.abs(masked_ssim_reverse(1.0, saved)).mean(axis=0))
    return found[0], found[1]


CASES = {
    "Needle": (needle_opacity, f"C2: opacity {FAR} px from its middle", "difference of large products",
               "sum of two squares"),
    "Opaque Gaussian": (opaque_gradient, "A4: gradient in front of it", "T = T / (1 - alpha)", "T kept or replayed"),
    "NaN under the instrument": (unknown_under_the_instrument, "L6: gradient of SSIM", "multiplied by the mask",
                                 "selected by the mask"),
}  # fmt: skip


def measured() -> dict[str, Pair]:
    """Both pictures of every case."""
    with np.errstate(all="ignore"):
        return {name: make() for name, (make, *_) in CASES.items()}


def drawn(found: dict[str, Pair]) -> Any:
    """The figure: one column per case, the usual formula above."""
    figure = new_figure(9.0, 6.4)
    panels = figure.subplots(2, len(found))
    for column, (name, pair) in zip(panels.T, found.items(), strict=True):
        _, what, usual, ours = CASES[name]
        top = float(pair[1].max())
        for axes, picture, way in zip(column, pair, (usual, f"endotsr: {ours}"), strict=True):
            axes.imshow(colour_mapped(picture, 0.0, top, "viridis"), interpolation="nearest")
            axes.set(xticks=[], yticks=[])
            name_axes(axes, x=way, title=f"{name}\n{what}" if axes is column[0] else "", sizes=SMALL)
    return figure
