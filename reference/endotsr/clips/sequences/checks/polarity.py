"""Whether pictures and depth support the polarity of the masks of a clip.

In: pictures, masks and depth, one frame after another. Out: a note on the tissue share with the evidence, and a
finding where the evidence contradicts the stated polarity.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.flips import FLIPS
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.mask_polarity import PolarityEvidence
from endotsr.method.kernels.arrays import BoolArray

# Grey levels of red minus blue that a flip of the masks gains: at most 10 on three recorded and twelve simulated clips,
# 45 to 70 where masks of the recorded ones with instruments are mirrored. Those of simulated ones gain 17 to 30.
REDDER = 30.0
STEP = 4  # pixels between the sampled rows and columns
OPTION = "--masks FOLDER --excluded-value"
OTHER = {"white": "black", "black": "white", "nonzero": "black"}


class MaskEvidence:
    """Sums over tissue and excluded pixels of the frames of a clip."""

    def __init__(self, step: int = STEP) -> None:
        self._step = step
        self.tissue, self.size = 0, 0  # of all pixels; the other sums are over sampled ones
        self.pixels, self.without_depth, self.redness = np.zeros(2), np.zeros(2), np.zeros(2)  # tissue, excluded
        self.flipped = np.zeros((len(FLIPS), 2))  # redness of tissue and excluded pixels under each flip of the masks

    def add(self, picture: NDArray[np.uint8], tissue: BoolArray, depth: NDArray | None) -> None:
        """One frame: picture (H, W, 3), tissue (H, W) bool, depth (H, W) or None, 0 = missing."""
        self.tissue += np.count_nonzero(tissue)
        self.size += tissue.size
        step = self._step
        mask, small = tissue[::step, ::step], picture[::step, ::step].astype(np.int32)
        redness = small[:, :, 0] - small[:, :, 2]
        for k, part in enumerate((mask, ~mask)):
            self.pixels[k] += np.count_nonzero(part)
            self.redness[k] += redness[part].sum()
            for f, axes in enumerate(FLIPS.values()):
                self.flipped[f, k] += redness[np.flip(part, axes)].sum()
            self.without_depth[k] += 0 if depth is None else np.count_nonzero(depth[::step, ::step][part] == 0)

    @property
    def evidence(self) -> PolarityEvidence | None:
        """The evidence; None if the masks exclude everything or nothing."""
        if not self.pixels.all():
            return None
        missing, red = self.without_depth / self.pixels, self.redness / self.pixels
        total = float(self.without_depth.sum() / self.pixels.sum())
        return PolarityEvidence(float(missing[0]), float(missing[1]), total, float(red[0]), float(red[1]))

    def findings(self, where: str, excluded_value: str) -> list[Finding]:
        """A warning with both readings, if the pictures contradict the stated one."""
        evidence = self.evidence
        if evidence is None or not evidence.against:
            return []
        fraction, other = self.tissue / self.size, OTHER[excluded_value]
        what = (
            f"with {excluded_value} = excluded, {fraction:.1%} of the pixels are tissue, and {evidence.said}; with"
            f" {other} = excluded ({OPTION} {other}), {1 - fraction:.1%} would be"
        )
        return [finding("inverted-masks", where, what)]

    def flip_findings(self, where: str) -> list[Finding]:
        """A warning if the excluded pixels are as red as the tissue, and those under flipped masks are not."""
        if not self.pixels.all():
            return []
        stored = float(np.subtract(*(self.redness / self.pixels)))
        gains = self.flipped[:, 0] / self.pixels[0] - self.flipped[:, 1] / self.pixels[1]
        best = int(np.argmax(gains))
        if gains[best] < max(REDDER, stored + REDDER, -stored):  # inverted masks have the last
            return []
        what = (
            f"the tissue of the masks is {stored:.0f} grey levels redder than what they exclude, and"
            f" {gains[best]:.0f} with masks that are {list(FLIPS)[best]}"
        )
        return [finding("flipped-masks", where, what)]

    def note(self, excluded_value: str) -> str:
        """The tissue share in words, with the evidence."""
        evidence, tissue = self.evidence, f"{self.tissue / self.size:.1%} of the pixels are tissue"
        return f"masks: {excluded_value} = excluded: {tissue}" + (f"; {evidence.said}" if evidence else "")
