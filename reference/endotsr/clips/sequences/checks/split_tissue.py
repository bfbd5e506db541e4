"""Tissue on the two sides of the split: pixels to train on, and pixels to evaluate.

In: whether each frame has tissue, and whether it has tissue with depth. Out: findings.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, IndexArray


class SplitTissue:
    """What is known of the frames of a clip; a frame that cannot be read counts as one with both."""

    def __init__(self, count: int) -> None:
        self.tissue, self.lifted = np.ones(count, bool), np.ones(count, bool)

    def add(self, i: int, tissue: NDArray[np.bool_] | None, depth: NDArray[np.float32] | None) -> None:
        """Add frame `i`. tissue, depth: (H, W); None: without masks, or unreadable."""
        if tissue is not None:
            self.tissue[i] = tissue.any()
        if depth is not None:
            self.lifted[i] = ((depth > 0) & (True if tissue is None else tissue)).any()


def split_findings(
    tissue: BoolArray, lifted: BoolArray, split: tuple[IndexArray, IndexArray], where: str
) -> list[Finding]:
    """Findings on a split whose training frames, or held-out frames, have no tissue at all.

    tissue   (n,) whether each frame has tissue
    lifted   (n,) whether it has tissue with depth, from which a training starts
    split    training and held-out frames
    """
    train, test = split
    found = []
    if not lifted[train].any():
        what = f"none of the {len(train)} training frames has a pixel that is tissue with depth"
        found.append(finding("nothing-to-train", where, what))
    if not tissue[test].any():
        what = f"none of the {len(test)} held-out frames has tissue"
        found.append(finding("nothing-to-evaluate", where, what))
    return found


def loaded_split_findings(sequence: Sequence, where: str) -> list[Finding]:
    """`split_findings` of a sequence that was read."""
    tissue = np.array([mask.any() for mask in sequence.masks])
    lifted = np.array([((plane > 0) & mask).any() for plane, mask in zip(sequence.depth, sequence.masks)])
    return split_findings(tissue, lifted, (sequence.train_index, sequence.test_index), where)
