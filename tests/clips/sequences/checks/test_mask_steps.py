"""Masks against their neighbours in time: one that differs from both, and masks of two polarities."""

import numpy as np
import pytest

from data_folder import recorded_masks
from endotsr.clips.sequences.checks.masks import MaskSteps, mask_findings


def test_a_mask_is_unlike_only_where_both_neighbours_agree():
    """Exact fractions; a tool that comes to stay is no finding, nor is a frame beside one without a mask."""
    masks = np.ones((10, 10, 20), bool)
    masks[:, -1, -1] = False  # a mask of one value has no fraction
    masks[2, :2, :5] = False  # 10 of 200 pixels in one frame alone
    masks[8:, 5:] = False  # from frame 8 on
    steps = MaskSteps()
    for i, mask in enumerate(masks):
        steps.add(i, mask)
    assert steps.fractions == {i: 0.05 if i == 2 else 0.0 for i in range(1, 9)}
    assert [(f.code, f.frame, "5.0%" in f.what) for f in steps.findings("masks")] == [("unlike-mask", 2, True)]
    gap = MaskSteps()
    for i, mask in enumerate([*masks[:3], None, *masks[3:]]):
        gap.add(i, mask)
    assert set(gap.fractions) == {1, *range(5, 10)}


def masks_of(*inverted, count=10):
    masks = np.ones((count, 20, 20), bool)
    for i in range(count):
        masks[i, 5:10, 2 + i // 2 : 10] = False  # an instrument that moves on
    masks[list(inverted)] ^= True
    return masks


@pytest.mark.parametrize(("inverted", "frame", "fewer"), [((7, 8, 9), 7, 3), (range(6), 6, 4), ((3, 7), 3, 2)])
def test_masks_of_two_polarities_are_named_once(inverted, frame, fewer):
    found = [f for f in mask_findings(masks_of(*inverted), "masks") if f.code == "turned-masks"]
    assert [(f.frame, f.what.split(" have")[0]) for f in found] == [(frame, f"{fewer} of 10 masks")]


def test_one_inverted_mask_and_an_instrument_over_the_view_are_no_second_polarity():
    """Of one inverted mask, its neighbours are not named: they differ from it alone."""
    assert [(f.code, f.frame) for f in mask_findings(masks_of(4), "masks")] == [("unlike-mask", 4)]
    covered = masks_of()
    covered[4:7] = False
    covered[4:7, 18:] = True
    assert "turned-masks" not in {f.code for f in mask_findings(covered, "masks")}
    assert "turned-masks" not in {f.code for f in mask_findings(masks_of(), "masks")}


def test_a_mask_is_compared_with_what_is_usual_in_its_clip():
    """A thin tool that crosses the picture differs from both neighbours in every frame."""
    masks = np.ones((12, 10, 100), bool)
    for i in range(12):
        masks[i, :, 4 * i : 4 * i + 3] = False  # 3 % each, nowhere twice
    assert mask_findings(masks, "masks") == []
    masks[6, :, 60:80] = False
    assert [f.frame for f in mask_findings(masks, "masks")] == [6]


def unlike(masks):
    """The frames whose mask is unlike its neighbours."""
    return [found.frame for found in mask_findings(np.asarray(masks), "masks") if found.code == "unlike-mask"]


@pytest.mark.data
def test_the_masks_of_cutting_are_unlike_where_its_stereo_matching_failed():
    """Frames 73 and 74 and, likewise, 145 and 146. Frame 73 stays below the limit: its neighbour is wrong likewise."""
    assert unlike(recorded_masks("endonerf_cutting", "masks")) == [74, 145, 146]
    assert unlike(recorded_masks("endonerf_pulling", "masks")) == []


@pytest.mark.parametrize(("rows", "frames"), [(6, []), (10, [6])])
def test_the_limit_follows_the_motion_of_the_masks(rows, frames):
    """A tool moves by half of its width: masks two apart differ in 20 % of the pixels.

    In one frame, 17 or 28 % of the pixels differ from both neighbours.
    """
    masks = np.ones((14, 10, 100), bool)
    for i in range(14):
        masks[i, :, 5 * i : 5 * i + 10] = False
    assert mask_findings(masks, "masks") == []
    masks[6, :rows, 70:98] = False
    found = mask_findings(masks, "masks")
    assert [f.frame for f in found] == frames and all("(limit in this clip 24.0%)" in f.what for f in found)


@pytest.mark.data
@pytest.mark.parametrize("name", ["endonerf_pulling", "endonerf_cutting"])
def test_fewer_frames_and_parts_of_the_recorded_clips_have_no_unlike_mask(name):
    """The masks of the instruments, which are right: every frame of the second to fourth, and parts of the picture."""
    masks = np.stack(recorded_masks(name, "gt_masks"))
    for every in (2, 3, 4):
        assert unlike(masks[::every]) == unlike(masks[1::every]) == [], every
    for rows, columns in ((256, 0), (0, 320), (192, 240), (128, 160), (256, 320)):
        assert unlike(masks[:, rows : rows + 256, columns : columns + 320]) == [], (rows, columns)
