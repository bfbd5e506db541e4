"""Checks of the colours of neighbouring frames: another light or a grey picture, and a part that was not decoded.

In: small pictures of the frames, in time order. Out: findings. The ratio of two channels does not depend on the
exposure; a change of light, of white balance or of the way to colour changes it at once.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray, FloatArray

LIT, WHITE = 20, 250  # grey levels of the brightest channel: darker and brighter pixels have no colour of their own
# Factor of red over green or over blue from frame to frame: at most 1.02 on four recorded clips, and 1.07 on seven
# simulated ones, where smoke comes up. A picture without its colours is 1.3 or more away from those beside it.
COLOUR_JUMP = 1.2
PLAIN, USUAL = 0.05, 0.01  # of a picture in exactly one colour: at most 0.006 on these clips; and beside the frame


def colour_findings(small: Sequence[NDArray[np.int16]], readable: BoolArray, where: str) -> list[Finding]:
    """A warning for each step to other colours, and for each frame of which a part has one colour.

    readable   frames that are neither black nor white
    """
    found = []
    for i, (before, here) in enumerate(pairwise(map(ratios, small)), 1):
        apart = np.exp(np.abs(here - before))
        if readable[i - 1] and readable[i] and apart.max() > COLOUR_JUMP:
            other = ("green", "blue")[int(apart.argmax())]
            grey = " (the picture is grey)" if (small[i] == small[i][:, :, :1]).all() else ""
            what = f"red over {other} changes by a factor of {apart.max():.2f}{grey}"
            found.append(finding("colour-jump", where, what, i))
    return found + _plain_findings(small, where)


def ratios(small: NDArray[np.int16]) -> FloatArray:
    """(2,) logarithm of red over green and over blue, of the means over the lit pixels; 0 without any."""
    lit = small[small.max(axis=2) > LIT]
    if not len(lit):
        return np.zeros(2)
    red, green, blue = np.maximum(lit.mean(axis=0), 1.0)
    return np.log([red / green, red / blue])


def _plain_findings(small: Sequence[NDArray[np.int16]], where: str) -> list[Finding]:
    """A warning for each frame that has a part of one colour, where the frames beside it have none of this colour."""
    found = []
    for i, picture in enumerate(small):
        colour, part = most_frequent(picture)
        beside = [small[k] for k in (i - 1, i + 1) if 0 <= k < len(small)]
        if part > PLAIN and beside and max(_part(other, colour) for other in beside) < USUAL:
            level = " ".join(str(value) for value in colour)
            what = f"{part:.0%} of the picture has exactly the colour {level}, and the frames beside it have hardly any"
            found.append(finding("plain-frame", where, what, i))
    return found


def most_frequent(small: NDArray[np.int16]) -> tuple[tuple[int, ...], float]:
    """The colour that most of the lit pixels have, and the part of the picture that has it."""
    brightest = small.max(axis=2)
    lit = small[(brightest > LIT) & (brightest < WHITE)]
    if not len(lit):
        return (0, 0, 0), 0.0
    colours, counts = np.unique(lit, axis=0, return_counts=True)
    best = int(counts.argmax())
    return tuple(int(value) for value in colours[best]), float(counts[best] / brightest.size)


def _part(small: NDArray[np.int16], colour: tuple[int, ...]) -> float:
    return float((small == colour).all(axis=2).mean())
