"""First poses by flow and resection, and what happens where frames show too little."""

import numpy as np
import pytest
from moving_clip import centres, moving_views, path_error, without_pose

from endotsr.clips.poses.chain import LONGEST_GAP, chained
from endotsr.clips.poses.estimate import estimated
from endotsr.clips.poses.matches import matcher_of
from endotsr.clips.poses.movement import pairs_that_move
from endotsr.clips.poses.views import Views
from endotsr.errors import InputError

VIEWS, TRUE = moving_views()


def with_mask(frames):
    """The clip with these frames masked whole."""
    tissue = VIEWS.tissue.copy()
    tissue[frames] = False
    return VIEWS._replace(tissue=tissue)


def test_the_path_is_found():
    found = estimated(VIEWS)
    assert without_pose(found.poses) == [] and found.moves.answer == "moving"
    assert path_error(found.poses, TRUE) < 0.15
    assert found.left < 0.25 * found.still and found.agreeing > 0.9
    length = np.linalg.norm(np.diff(centres(TRUE), axis=0), axis=1).sum()
    assert found.path == pytest.approx(length, rel=0.03)


def test_masked_frames_are_bridged_and_the_track_is_picked_up():
    found = estimated(with_mask([5, 6, 7]))
    assert without_pose(found.poses) == [5, 6, 7]
    kept = [k for k in range(VIEWS.count) if k not in without_pose(found.poses)]
    assert path_error([found.poses[k] for k in kept], [TRUE[k] for k in kept]) < 0.2


def test_the_first_frames_may_be_masked():
    found = chained(matcher_of(with_mask([0, 1])))
    assert without_pose(found.poses) == [0, 1] and found.last == VIEWS.count - 1


def test_a_gap_that_is_too_long_is_refused_with_its_frames():
    assert VIEWS.count > LONGEST_GAP + 3
    with pytest.raises(
        InputError, match=r"frames 2 to 10 cannot be registered: 9 in a row.*--frames :2 and --frames 11:"
    ):
        chained(matcher_of(with_mask(range(2, 11))))


def test_noise_after_a_cut_has_no_pose():
    images = VIEWS.images.copy()
    images[7:] = np.random.default_rng(0).integers(0, 255, images[7:].shape, dtype=np.uint8)
    assert without_pose(chained(matcher_of(VIEWS._replace(images=images))).poses) == list(range(7, VIEWS.count))


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_another_scene_after_a_cut_is_not_registered_to_the_first(seed):
    """Flow between the two returns to a fifth of the points by chance, and a pose can be fitted to them."""
    other = moving_views(seed=seed)[0]
    planes = [np.concatenate([one, two[:4]]) for one, two in zip(VIEWS[:3], other[:3], strict=True)]
    matcher = matcher_of(Views(*planes, VIEWS.camera))
    assert without_pose(chained(matcher).poses) == [14, 15, 16, 17]
    assert matcher.by_flow(13, 14).count > 60 and not matcher.by_flow(13, 14).related
    assert matcher.by_flow(12, 13).support > 0.7 and matcher.by_flow(0, 7).related
    assert all({pair.source, pair.target} <= set(range(14)) for pair in pairs_that_move(matcher) if pair.source < 14)


def test_identical_frames_have_one_pose():
    order = [0, 1, 1, 2]
    found = chained(matcher_of(Views(*(plane[order] for plane in VIEWS[:3]), VIEWS.camera)))
    np.testing.assert_allclose(found.poses[1].translation, found.poses[2].translation, atol=1e-3)


def test_one_frame_is_refused():
    with pytest.raises(InputError, match="one frame: there is no motion"):
        estimated(Views(*(plane[:1] for plane in VIEWS[:3]), VIEWS.camera))


def test_depth_that_is_not_finite_is_no_depth():
    depth = VIEWS.depth.copy()
    depth[:, ::2] = np.nan
    depth[:, 1, :] = -5
    assert without_pose(chained(matcher_of(VIEWS._replace(depth=depth))).poses) == []
    with pytest.raises(InputError, match="no frame has depth"):
        estimated(VIEWS._replace(depth=np.full_like(depth, np.nan)))


def test_without_usable_tissue_nothing_is_estimated():
    with pytest.raises(InputError, match="no frame has usable tissue with depth"):
        chained(matcher_of(with_mask(range(VIEWS.count))))


def test_a_chain_continues_where_it_was():
    matcher, kept = matcher_of(VIEWS), []
    whole = chained(matcher, kept.append)
    again = chained(matcher, begun=kept[5])
    assert len(kept[5].poses) == 7
    for one, other in zip(whole.poses, again.poses, strict=True):
        np.testing.assert_array_equal(one.translation, other.translation)
