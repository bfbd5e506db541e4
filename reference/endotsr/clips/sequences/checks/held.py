"""Masks that are held for several frames: annotated at every fifth frame, say, and copied to the others.

In: the masks in time order. Out: a finding. Masks of each frame are expected to change from frame to frame while an
instrument moves, and at no regular distance where it hardly does, as those of the recorded clips.
"""

from collections import Counter

import numpy as np

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray

FEWEST = 5  # changes of the mask
REGULAR = 0.9  # of the distances between changes: the same number of frames, at least two


class HeldMasks:
    """The frames at which the mask changes, from one pass over the masks."""

    def __init__(self) -> None:
        self._changes: list[int] = []
        self._last: BoolArray | None = None
        self._count = 0

    def add(self, mask: BoolArray | None) -> None:
        """The mask of the next frame, (H, W); None where there is none, which ends no run of equal masks."""
        if mask is not None:
            if self._last is not None and not np.array_equal(mask, self._last):
                self._changes.append(self._count)
            self._last = mask
        self._count += 1

    def findings(self, where: str) -> list[Finding]:
        """A warning with the number of frames for which a mask is held."""
        distances = np.diff(self._changes).tolist()
        if len(self._changes) < FEWEST:
            return []
        held, often = Counter(distances).most_common(1)[0]
        if held < 2 or often < REGULAR * len(distances):
            return []
        what = (
            f"the mask changes once every {held} frames, first in frame {self._changes[0]}:"
            f" {often} of {len(distances)} distances between changes are {held} frames"
        )
        return [finding("held-masks", where, what)]
