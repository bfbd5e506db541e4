"""Two frames, or two masks, in each other's place.

In: small pictures or the masks of all frames, in order. Out: findings. Motion takes a frame farther from the one before
the last than from the last. Where two neighbours are exchanged, both stand nearer to the frame beyond the other.
"""

import numpy as np

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray, FloatArray

FEWEST = 8  # frames
# Steps to neighbours over steps across them, the smaller of both sides: at most 0.87 on five recorded clips and 0.95 on
# eleven simulated ones that move; 1.1 to 6 where two frames are exchanged, in nine of ten places. The limit lies a
# third above the sound clips, and so passes over some exchanges.
EXCHANGED = 1.3
MOVES = 0.85  # median of the same: 0.51 to 0.80 on these clips, 0.99 on one that stands still
SELDOM = 0.1  # of the frames: motion that is fast for the frame rate looks like many exchanges
# As EXCHANGED, for masks, and the part of the pixels by which a mask changes, there and usually: at most 1.0 on these
# clips, but up to 3.4 in parts of their pictures, where an instrument passes by. There the step between the two is as
# large as those beside it, and after an exchange it is about half of them. With both limits, one of 120 parts of the
# clips is named, and 10 are without; of exchanged masks in such parts, 56 % and 73 %.
MASKS, LEAST_CHANGE, BESIDE = 1.5, 1e-3, 1.1


def steps_across(small: list[np.ndarray]) -> FloatArray:
    """(n - 2,) mean difference of each picture from the one before the last; NaN between unlike sizes."""
    pairs = zip(small, small[2:])
    return np.array([np.abs(b - a).mean() if a.shape == b.shape else np.nan for a, b in pairs])


def exchanged_places(near: FloatArray, across: FloatArray, least: float) -> list[int]:
    """Frames i that seem to be exchanged with i + 1.

    near, across   (n - 1,), (n - 2,) steps between neighbours and across one frame
    """
    if len(across) < FEWEST - 2 or not (np.isfinite(near).all() and np.isfinite(across).all()):
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = np.nan_to_num(np.minimum(near[:-2] / across[:-1], near[2:] / across[1:]), posinf=0.0)  # i from 1
    found = np.flatnonzero(sides > least)
    if np.median(sides) > MOVES or len(found) > max(1, SELDOM * len(sides)):
        return []
    return [int(k) + 1 for k in found]


def exchanged_findings(
    small: list[np.ndarray], near: FloatArray, names: list[str], readable: BoolArray, where: str
) -> list[Finding]:
    """A warning for each pair of frames that seem to be exchanged.

    near       from `steps_between`
    readable   frames that are neither black nor white
    """
    if not readable.all():
        return []
    what = "{} and {} seem to be exchanged: each is nearer to the frame beyond the other"
    places = exchanged_places(near, steps_across(small), EXCHANGED)
    return [finding("exchanged-frames", where, what.format(names[i], names[i + 1]), i) for i in places]


class MaskOrder:
    """The steps between masks, from one pass over them in time order."""

    def __init__(self) -> None:
        self._last: list[BoolArray] = []
        self.near: list[float] = []
        self.across: list[float] = []

    def add(self, mask: BoolArray | None) -> None:
        """The mask of the next frame, (H, W); None where there is none."""
        for steps, back in ((self.near, 1), (self.across, 2)):
            if len(self._last) >= back:
                before = self._last[-back]
                known = mask is not None and mask.shape == before.shape
                steps.append(float(np.mean(mask != before)) if known else np.nan)
        self._last = [*self._last, np.zeros((0, 0), bool) if mask is None else mask][-2:]

    def findings(self, where: str) -> list[Finding]:
        """A warning for each pair of masks that seem to be exchanged."""
        near, across = np.array(self.near), np.array(self.across)
        places = [
            i for i in exchanged_places(near, across, MASKS) if min(near[i - 1], near[i + 1]) > BESIDE * near[i]
        ] if near.size and np.median(near) > LEAST_CHANGE else []  # fmt: skip
        what = "the masks of this frame and of the next one seem to be exchanged"
        return [finding("exchanged-masks", where, what, i) for i in places if near[i] > LEAST_CHANGE]
