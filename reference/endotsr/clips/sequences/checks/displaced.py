"""Depth that lies some pixels beside its masks, and with them beside its pictures.

In: tissue and depth of sampled frames. Out: findings. Depth that is missing where the masks exclude shows its place by
its holes. With the tissue m and the pixels with depth k, the shift (x, y) with the least

    apart(x, y) = mean over the frames of the part of the pixels p with m(p) != k(p + (x, y))

is taken for that of the depth.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray
from endotsr.untrusted.names import counted

SAMPLED = 6  # frames of a clip
FARTHEST, SHORTEST = 16, 2  # pixels: largest shift that is tried, and shortest of a finding
SHIFTS, ROUNDS = range(-FARTHEST, FARTHEST + 1), 2  # pixels in one direction; searches in each direction
# Part of the pixels where holes and masks differ, and times that at the best shift. In parts of two recorded and of
# three simulated clips whose holes follow their masks they differ nowhere; with depth that is displaced by 3 pixels, in
# 0.9 to 5.4 % of the pixels where the edges of the masks cross the shift. The holes of the recorded clips and masks of
# the instruments alone differ in 2.7 to 8.6 %, at most 2.1 times that at the best shift.
APART, BETTER = 0.005, 3.0


class DisplacedDepth:
    """Holes and masks of a clip of `count` frames, from one pass over them."""

    def __init__(self, count: int) -> None:
        self._sampled = set(even_frames(count, SAMPLED))
        self._known: list[BoolArray] = []
        self._tissue: list[BoolArray] = []

    def add(self, i: int, tissue: BoolArray | None, depth: NDArray[np.float32] | None) -> None:
        """Frame i: tissue (H, W) and depth (H, W), 0 = none, or None where there is none."""
        if i in self._sampled and tissue is not None and depth is not None and tissue.shape == depth.shape:
            self._known.append(depth > 0)
            self._tissue.append(tissue.copy())  # the caller may use its mask again

    def findings(self, where: str) -> list[Finding]:
        """A warning on displaced depth; none if a sampled frame has no mask or no depth, or another size."""
        if len(self._known) < len(self._sampled) or len({plane.shape for plane in self._tissue}) != 1:
            return []
        return displaced_finding(np.stack(self._known), np.stack(self._tissue), where)


def loaded_displaced_findings(sequence: Sequence, where: str) -> list[Finding]:
    """`DisplacedDepth.findings` of a sequence in memory."""
    parts = DisplacedDepth(sequence.count)
    for i in even_frames(sequence.count, SAMPLED):
        parts.add(i, sequence.masks[i], sequence.depth[i])
    return parts.findings(where)


def displaced_finding(known: BoolArray, tissue: BoolArray, where: str) -> list[Finding]:
    """A warning on depth whose holes lie beside the masks; known, tissue: (n, H, W)."""
    if min(tissue.shape[1:]) < 4 * FARTHEST or (unmoved := _apart(known, tissue, 0, 0)) < APART:
        return []
    x = y = 0
    for _ in range(ROUNDS):
        x = min(SHIFTS, key=lambda k: (_apart(known, tissue, k, y), abs(k)))
        y = min(SHIFTS, key=lambda k: (_apart(known, tissue, x, k), abs(k)))
    moved = _apart(known, tissue, x, y)
    if max(abs(x), abs(y)) < SHORTEST or unmoved < BETTER * moved:
        return []
    ways = [
        f"{counted(abs(shift), 'pixel')} {way[shift > 0]}"
        for shift, way in ((x, ("to the left", "to the right")), (y, ("up", "down")))
        if shift
    ]
    what = (
        f"the depth seems to lie {' and '.join(ways)} of its place: its holes differ from the masks in {unmoved:.1%}"
        f" of the pixels, and in {moved:.1%} if moved back"
    )
    return [finding("displaced-depth", where, what)]


def _apart(known: BoolArray, tissue: BoolArray, x: int, y: int) -> float:
    """The part of the pixels where depth that is moved back by (x, y) is missing on tissue, or is there without it."""
    (height, width), edge = tissue.shape[1:], FARTHEST
    moved = known[:, edge + y : height - edge + y, edge + x : width - edge + x]
    return float(np.mean(moved != tissue[:, edge : height - edge, edge : width - edge]))
