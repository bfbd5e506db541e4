"""Checks of the masks against their neighbours in time.

In: the masks one after another. Out: findings. A mask that follows the depth excludes what the stereo matching did not
find; where the matching fails in a frame, its mask differs from those before and after. Masks of two programs may have
two polarities.
"""

import numpy as np

from endotsr.clips.sequences.checks.exchanged import MaskOrder
from endotsr.clips.sequences.checks.held import HeldMasks
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray

UNLIKE = 0.01  # of the pixels: a mask that differs from both neighbours; 0.006 at most on a clip with a fast instrument
USUAL = 4.0  # the same as a multiple of the median of the clip
# Pixels that differ from both neighbours relative to those in which masks two apart differ, their median over so many
# frames around: where an instrument is fast, in a small picture or with few frames a second, both are large. At most
# 1.12 on every second, third and fourth frame, quarters and centres of four clips with instruments (1.9 in one other
# part); 1.24 to 3.3 where the stereo matching of the cutting clip failed.
APART, AROUND = 1.2, 5
TURNED, BOTH = 0.8, 0.5  # of the pixels that differ from the mask before: of all, and each of tissue and excluded ones


class MaskTurns:
    """The frames at which the polarity of the masks changes, from one pass over them in time order."""

    def __init__(self) -> None:
        self.frames: list[int] = []
        self._last, self._count = np.zeros((0, 0), bool), 0

    def add(self, mask: BoolArray | None) -> None:
        """The mask of the next frame, (H, W), True = tissue; None where there is none."""
        mask = np.zeros((0, 0), bool) if mask is None else mask
        before = self._last
        if mask.shape == before.shape and before.any() and not before.all():
            turned = mask != before
            if turned.mean() > TURNED and min(turned[before].mean(), turned[~before].mean()) > BOTH:
                self.frames.append(self._count)
        self._last, self._count = mask, self._count + 1

    @property
    def beside(self) -> set[int]:
        """Frames that differ from one neighbour by their polarity, and not from both."""
        both = {i for i in self.frames if i + 1 in self.frames}
        return {i + k for i in self.frames for k in (-1, 0)} - both

    def findings(self, where: str) -> list[Finding]:
        """A warning on masks of two polarities, if each has two masks or more."""
        fewer = len(smaller_part(self.frames, self._count))
        if fewer < 2:
            return []
        what = f"{fewer} of {self._count} masks have another polarity than the rest; here it changes for the first time"
        return [finding("turned-masks", where, what, self.frames[0])]


def smaller_part(changes: list[int], count: int) -> list[int]:
    """Of `count` frames between two states, those in the rarer one; of equally many, those after the first change.

    changes   ascending frames at which the other state begins
    """
    ends = [*changes, count]
    other = [i for a, b in zip(ends[::2], ends[1::2]) for i in range(a, b)]
    return sorted(set(range(count)) - set(other)) if 2 * len(other) > count else other


class MaskSteps:
    """The fraction of pixels in which each mask differs from both neighbours, from one pass over the masks.

    `add` takes the masks in time order, None where a frame has none. A frame counts if it and both of its neighbours
    have a mask of one size with tissue and excluded pixels. A mask of one value is a kind of its own, see
    `clips.sequences.checks`: the instrument left the view or covers it, and what follows differs from it anyway.
    """

    def __init__(self) -> None:
        self.fractions: dict[int, float] = {}  # by frame
        self._across: dict[int, float] = {}  # part of the pixels in which the masks before and after it differ
        self._order, self._turns, self._held = MaskOrder(), MaskTurns(), HeldMasks()
        self._last: tuple[BoolArray | None, BoolArray | None] = (None, None)

    def add(self, frame: int, mask: BoolArray | None) -> None:
        """The mask of a frame, (H, W), True = tissue; stored until the second next one."""
        self._order.add(mask)
        self._turns.add(mask)
        self._held.add(mask)
        before, middle = self._last
        if before is not None and middle is not None and mask is not None:
            if before.shape == middle.shape == mask.shape and all(0 < m.mean() < 1 for m in (before, middle, mask)):
                self.fractions[frame - 1] = float(np.mean((before == mask) & (middle != mask)))
                self._across[frame - 1] = float(np.mean(before != mask))
        self._last = (middle, mask)

    def findings(self, where: str) -> list[Finding]:
        """A warning for every frame whose mask differs from both neighbours unusually much, or is exchanged."""
        usual, beside = USUAL * float(np.median(list(self.fractions.values()) or [0.0])), self._turns.beside
        found = []
        for i, part in self.fractions.items():
            limit = max(UNLIKE, usual, APART * self._motion(i))
            if part > limit and i not in beside:
                what = f"its mask differs from both neighbours in {part:.1%} of the pixels"
                found.append(finding("unlike-mask", where, f"{what} (limit in this clip {limit:.1%})", i))
        return self._turns.findings(where) + found + self._order.findings(where) + self._held.findings(where)

    def _motion(self, frame: int) -> float:
        """Part of the pixels in which masks two apart differ, the median around a frame."""
        around = [self._across[k] for k in range(frame - AROUND, frame + AROUND + 1) if k in self._across]
        return float(np.median(around))


def mask_findings(masks: BoolArray, where: str) -> list[Finding]:
    """`MaskSteps.findings` of masks (n, H, W)."""
    steps = MaskSteps()
    for i, mask in enumerate(masks):
        steps.add(i, mask)
    return steps.findings(where)
