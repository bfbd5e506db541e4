"""What pictures say about the polarity of masks: right ones are accepted, inverted ones are named."""

from itertools import product

import numpy as np
import pytest

from data_folder import data_folder
from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.mask_polarity import PolarityEvidence


def test_right_masks_are_accepted_where_depth_is_missing_on_tissue_alone():
    """Depth without a dark border, which masks of the instruments alone leave to the tissue."""
    border = PolarityEvidence(0.4, 0.1, 0.3, red_tissue=60.0, red_excluded=2.0)
    assert border.depth == -1 and border.colour == 1 and not border.against
    assert "depth is missing on 40.0% of the tissue" in border.said and "but mean red minus blue is 60" in border.said
    assert PolarityEvidence(0.4, 0.1, 0.3, red_tissue=30.0, red_excluded=29.0).against


def test_colour_decides_where_depth_does_not():
    assert PolarityEvidence(0.0, 0.0, 0.0, red_tissue=2.0, red_excluded=60.0).against
    assert not PolarityEvidence(0.0, 0.0, 0.0, red_tissue=60.0, red_excluded=2.0).against
    assert not PolarityEvidence(0.0, 0.0, 0.0, red_tissue=10.0, red_excluded=25.0).against
    assert not PolarityEvidence(0.0, 1.0, 0.2, red_tissue=2.0, red_excluded=60.0).against


def test_masks_that_exclude_nothing_give_no_evidence():
    empty = MaskEvidence()
    empty.add(np.zeros((8, 8, 3), np.uint8), np.ones((8, 8), bool), None)
    assert empty.evidence is None and empty.findings("clip", "white") == []
    assert empty.note("white") == "masks: white = excluded: 100.0% of the pixels are tissue"


def test_the_printed_share_of_tissue_counts_every_pixel():
    tissue = np.ones((8, 8), bool)
    tissue[1::4] = False  # rows that the evidence does not sample
    masks = MaskEvidence()
    masks.add(np.zeros((8, 8, 3), np.uint8), tissue, None)
    assert masks.note("white") == "masks: white = excluded: 75.0% of the pixels are tissue"


def sampled(clip, masks, count):
    """Pictures, tissue masks and depth of some frames."""
    folder = data_folder(clip)
    files = [sorted((folder / name).iterdir()) for name in ("images", masks, "depth")]
    for i in np.linspace(0, len(files[0]) - 1, count).astype(int):
        picture, mask, depth = (read_png(part[i]) for part in files)
        yield picture, mask < 128, depth


@pytest.mark.data
@pytest.mark.parametrize("clip, folder", [*product(("endonerf_pulling", "endonerf_cutting"), ("masks", "gt_masks"))])
@pytest.mark.parametrize("with_depth", [True, False])
def test_both_public_clips_given_and_inverted(clip, folder, with_depth):
    right, inverted = MaskEvidence(), MaskEvidence()
    for picture, tissue, depth in sampled(clip, folder, 4):
        right.add(picture, tissue, depth if with_depth else None)
        inverted.add(picture, ~tissue, depth if with_depth else None)
    assert right.findings(clip, "white") == []
    (found,) = inverted.findings(clip, "white")
    assert found.code == "inverted-masks" and "--excluded-value black" in found.what
