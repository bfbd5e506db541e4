"""Whether masks of key frames leave tissue, and whether the pictures support them.

In: the masks that a person or another program made for a few frames, and their pictures. Out: warnings, or an
`InputError` for masks that exclude nearly everything, such as inverted ones.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from endotsr.clips.formats.files import shortened
from endotsr.clips.masks.propose_masks import frames_without_tissue
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.clip import Picture
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray

MEANING = "use white = instrument, black = tissue"


def refuse_no_tissue(excluded: Sequence[BoolArray], names: Sequence[str], source: Path, margin: int) -> None:
    """Raises InputError if the carried masks leave hardly any tissue in all frames."""
    empty = [names[i] for i in frames_without_tissue(excluded)]
    if len(empty) == len(names):
        raise InputError(
            f"{source}: the carried masks, with a margin of {margin} px, leave hardly any tissue in all {len(empty)}"
            f" frames: {shortened(empty)}; {MEANING}, and a smaller --margin"
        )


def polarity_warnings(keys: Mapping[int, BoolArray], pictures: Sequence[Picture]) -> list[str]:
    """A warning if tissue is redder than the rest with the masks (H, W), True = instrument, read the other way."""
    found = MaskEvidence()
    for i, mask in keys.items():
        found.add(pictures[i], np.logical_not(mask), None)
    evidence = found.evidence
    if evidence is None or not evidence.against:
        return []
    return [f"warning: the masks of the key frames seem to be inverted: {evidence.said}; {MEANING}"]
