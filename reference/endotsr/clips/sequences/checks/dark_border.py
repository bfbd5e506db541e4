"""Dark borders that count as tissue: black bars of a letterbox, and the outside of a round field of view.

In: pictures and masks, one frame after another. Out: a finding with the size of the border.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray

STEP = 4  # pixels between the sampled rows and columns
DARK = 16  # grey levels; video in limited range has its black there
LEAST = 0.02  # of the pixels


class DarkBorder:
    """The brightest value of every sampled pixel while it counts as tissue, over the frames of a clip."""

    def __init__(self) -> None:
        self.brightest: NDArray[np.uint8] | None = None
        self.tissue: BoolArray | None = None  # in any frame

    def add(self, picture: NDArray[np.uint8], tissue: BoolArray | None) -> None:
        """One frame: picture (H, W, 3), tissue (H, W) or None without masks."""
        bright = picture[::STEP, ::STEP].max(axis=2)
        mask = np.ones(bright.shape, bool) if tissue is None else tissue[::STEP, ::STEP]
        if self.brightest is None or self.tissue is None:
            self.brightest, self.tissue = bright.copy(), mask.copy()
        elif self.brightest.shape == bright.shape:
            np.maximum(self.brightest, bright, out=self.brightest)
            self.tissue |= mask

    def findings(self, where: str) -> list[Finding]:
        """A warning, if at least 2 % of the pixels are a dark border that counts as tissue."""
        if self.brightest is None or self.tissue is None:
            return []
        dark = self.brightest <= DARK
        border = _from_the_edges(dark) & self.tissue
        fraction = float(border.mean())
        if fraction < LEAST or dark.all():
            return []
        what = f"{fraction:.1%} of the pixels are dark in every frame, from the edge inwards, and count as tissue"
        return [finding("dark-border", where, what + self.bars)]

    @property
    def bars(self) -> str:
        """Which crop removes whole rows and columns that are dark in every frame, as the end of a sentence; or ""."""
        if self.brightest is None:
            return ""
        dark = self.brightest <= DARK
        rows, columns = (np.flatnonzero(~dark.all(axis=axis)) for axis in (1, 0))
        if not rows.size or rows.size * columns.size == dark.size:
            return ""
        (x, right), (y, bottom) = ((STEP * int(part[0]), STEP * int(part[-1] + 1)) for part in (columns, rows))
        return f"; --crop {x} {y} {right - x} {bottom - y} keeps the rest"


def _from_the_edges(dark: BoolArray) -> BoolArray:
    """The dark pixels from which a row or a column of dark pixels leads to an edge of the picture."""
    reached = np.zeros_like(dark)
    for axis in (0, 1):
        for way in (slice(None), slice(None, None, -1)):
            turned = dark[way] if axis == 0 else dark[:, way]
            found = np.logical_and.accumulate(turned, axis=axis)
            reached |= found[way] if axis == 0 else found[:, way]
    return reached
