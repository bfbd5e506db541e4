"""Checks of the masks against their neighbours in time.

In: the masks one after another. Out: findings. A mask that follows the depth excludes what the stereo matching did not
find; where the matching fails in a frame, its mask differs from those before and after.
"""

import numpy as np

from endotsr.clips.sequences.checks.exchanged import MaskOrder
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray

UNLIKE = 0.01  # of the pixels: a mask that differs from both neighbours; 0.006 at most on a clip with a fast instrument
USUAL = 4.0  # the same as a multiple of the median of the clip


class MaskSteps:
    """The fraction of pixels in which each mask differs from both neighbours, from one pass over the masks.

    `add` takes the masks in time order, None where a frame has none. A frame counts if it and both of its neighbours
    have a mask of one size with tissue and excluded pixels. A mask of one value is a kind of its own, see
    `clips.sequences.checks`: the instrument left the view or covers it, and what follows differs from it anyway.
    """

    def __init__(self) -> None:
        self.fractions: dict[int, float] = {}  # by frame
        self._order = MaskOrder()
        self._last: tuple[BoolArray | None, BoolArray | None] = (None, None)

    def add(self, frame: int, mask: BoolArray | None) -> None:
        """The mask of a frame, (H, W), True = tissue; stored until the second next one."""
        self._order.add(mask)
        before, middle = self._last
        if before is not None and middle is not None and mask is not None:
            if before.shape == middle.shape == mask.shape and all(0 < m.mean() < 1 for m in (before, middle, mask)):
                self.fractions[frame - 1] = float(np.mean((before == mask) & (middle != mask)))
        self._last = (middle, mask)

    def findings(self, where: str) -> list[Finding]:
        """A warning for every frame whose mask differs from both neighbours unusually much, or is exchanged."""
        usual = float(np.median(list(self.fractions.values()) or [0.0]))
        unlike = {i: fraction for i, fraction in self.fractions.items() if fraction > max(UNLIKE, USUAL * usual)}
        what = "its mask differs from both neighbours in {:.1%} of the pixels"
        found = [finding("unlike-mask", where, what.format(fraction), i) for i, fraction in unlike.items()]
        return found + self._order.findings(where)


def mask_findings(masks: BoolArray, where: str) -> list[Finding]:
    """`MaskSteps.findings` of masks (n, H, W)."""
    steps = MaskSteps()
    for i, mask in enumerate(masks):
        steps.add(i, mask)
    return steps.findings(where)
