"""Frames whose prior depth reaches much farther than in the frames around them."""

import cv2
import numpy as np
import pytest

from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.depth_outliers import AROUND, FARTHER, outlying_frames, remove_outliers
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import PAPER, SequenceConfig
from synthetic_folder import write_synthetic_folder

FAR = 3  # frame of the folder with wrong far depths


def frames_of(limits):
    return [found.frame for found in outlying_frames(np.array(limits, float))]


def test_a_frame_beyond_the_usual_limit_is_found_with_its_ratio():
    limits = np.full(20, 80.0)
    limits[7] = 160.0
    (found,) = outlying_frames(limits)
    assert found == (7, 2.0, 80.0)


def test_the_threshold_is_a_ratio_to_the_median():
    limits = [80.0] * 20
    assert frames_of([*limits, 80.0 * FARTHER]) == []
    assert frames_of([*limits, 80.1 * FARTHER]) == [20]


@pytest.mark.parametrize("length, found", [(AROUND, True), (AROUND + 1, False)])
def test_a_change_of_the_scene_that_lasts_is_no_outlier(length, found):
    limits = [80.0] * 20 + [200.0] * length + [80.0] * 20
    assert (20 + length // 2 in frames_of(limits)) is found


def test_a_scope_that_moves_away_has_no_outliers():
    assert frames_of(40 * 1.07 ** np.arange(40)) == []


def test_frames_without_depth_have_no_limit():
    assert frames_of([0, 80, 80, 0, 80, 0, 300, 0]) == [6]
    assert frames_of([0, 80, 0, 80, 0, 300]) == []  # two limits are too few
    assert frames_of([0, 0, 0]) == frames_of([]) == frames_of([5.0]) == []


def test_removed_depths_are_zero_and_the_others_keep_their_bits():
    depth = np.random.default_rng(0).uniform(40, 80, (9, 8, 10)).astype(np.float32)
    depth[4, 0, :5] = 500
    before = depth.copy()
    note = remove_outliers(depth, outlying_frames(np.array([d.max() for d in depth], float)))
    assert (depth[4, 0, :5] == 0).all() and np.array_equal(np.delete(depth, 4, 0), np.delete(before, 4, 0))
    kept = depth[4] > 0
    assert np.array_equal(depth[4][kept], before[4][kept])
    assert "frame 4" in note


@pytest.fixture
def folder(tmp_path):
    write_synthetic_folder(tmp_path)
    file = sorted((tmp_path / "depth").iterdir())[FAR]
    depth = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    depth[:, :8] = 4 * depth.max()
    cv2.imwrite(str(file), depth)
    return tmp_path


def test_a_training_removes_them_only_if_configured(folder):
    kept, removed = (read_sequence(folder, SequenceConfig(depth_outliers=rule)) for rule in ("kept", "removed"))
    assert kept.depth[FAR, :, :8].any() and not removed.depth[FAR, :, :8].any()
    assert np.array_equal(np.delete(kept.depth, FAR, 0), np.delete(removed.depth, FAR, 0))
    assert [note for note in kept.notes if "depth-outliers" in note and f"frame {FAR}" in note]
    assert not [note for note in removed.notes if "depth-outliers" in note]
    assert [note for note in removed.notes if "outliers removed" in note and f"frame {FAR}" in note]


def test_check_names_the_frame_and_the_setting(folder):
    (found,) = [finding for finding in check_sequence(folder, PAPER).findings if finding.code == "depth-outliers"]
    assert f"frame {FAR} (" in found.what and "sequence.depth_outliers" in found.remedy


def test_the_limits_of_held_out_frames_count(folder):
    """Frame 3 is a training frame; without the depth of frame 1, which is held out, it has three limits around it."""
    sequence = read_sequence(folder, SequenceConfig(depth_outliers="removed"))
    assert sequence.test_index.tolist() == [1] and not sequence.depth[FAR, :, :8].any()
    for frame in (0, 1):
        file = sorted((folder / "depth").iterdir())[frame]
        cv2.imwrite(str(file), np.zeros_like(cv2.imread(str(file), cv2.IMREAD_UNCHANGED)))
    assert read_sequence(folder, SequenceConfig(depth_outliers="removed")).depth[FAR, :, :8].any()
