"""Masks that are noise: single pixels of tissue and of what is excluded, as a threshold on a picture makes them.

In: the masks one after another. Out: a finding. A pixel that differs from at least seven of its eight neighbours is a
speck. A line of one pixel, also a diagonal one, has specks at its two ends alone. The largest part of a mask that
consists of specks:

    masks of the two EndoNeRF clips, both kinds                      0.00008
    the same at half of their size                                   0.0016
    the posed sinus sequence, proposed masks, simulated scenes       0.00002
    highlights on the EndoNeRF clips, a channel above level 200      0.0013
    1 %, 5 %, 20 %, 50 % of the pixels set to one of two values      0.005, 0.025, 0.081, 0.092
    1 %, 5 %, 20 %, 50 % of the pixels exchanged                     0.010, 0.047, 0.100, 0.036

The limit is half of what the least noise has. In a small picture a few corners of an outline would exceed a fraction:
there is a least number of specks as well. A mask that follows the depth has holes. Those of the cutting clip, where its
stereo matching failed, are specks at a third of its size: frame 74 then has 0.0033, and a warning.
"""

import numpy as np

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray
from endotsr.untrusted.names import counted

MANY, FEWEST = 0.0025, 8  # specks of a mask that is noise: fraction of the pixels, and their number
ALIKE = 1  # most neighbours of a speck, of eight, that have its value


def speck_count(mask: BoolArray) -> int:
    """The number of specks of a mask (H, W). Outside of the picture its border pixels are repeated."""
    padded = np.pad(mask, 1, mode="edge").astype(np.uint8)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    set_around = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - padded[1:-1, 1:-1]
    return int(np.count_nonzero(np.where(mask, set_around, 8 - set_around) <= ALIKE))


class Specks:
    """The frames whose mask is noise, from one pass over the masks."""

    def __init__(self) -> None:
        self._frames: dict[int, float] = {}  # fraction of specks, by frame
        self._masks = 0

    def add(self, frame: int, mask: BoolArray | None) -> None:
        """The mask of a frame, (H, W); None where it has none."""
        if mask is None:
            return
        self._masks += 1
        count = speck_count(mask)
        if count >= FEWEST and count > MANY * mask.size:
            self._frames[frame] = count / mask.size

    def findings(self, where: str) -> list[Finding]:
        """One warning that names the frames."""
        if not self._frames:
            return []
        named = shortened([str(frame) for frame in self._frames])
        what = (
            f"{len(self._frames)} of {counted(self._masks, 'mask')} consist of single pixels, up to"
            f" {max(self._frames.values()):.1%} of a mask, which differ from what is around them: frames {named}"
        )
        return [finding("speckled-masks", where, what, next(iter(self._frames)) if len(self._frames) == 1 else None)]
