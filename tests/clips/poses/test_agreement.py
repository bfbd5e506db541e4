"""Given poses against pictures and depth, and whether the scope moves."""

import numpy as np
import pytest
from moving_clip import moving_views, still_views
from scipy.spatial.transform import Rotation

from endotsr.clips.poses.agreement import agreement
from endotsr.clips.poses.matches import matcher_of
from endotsr.clips.poses.movement import drift, movement, pairs_that_move
from endotsr.clips.poses.readings import readings
from endotsr.clips.poses.views import Views
from endotsr.method.splatting.camera import CameraPose

VIEWS, TRUE = moving_views()
MATCHER = matcher_of(VIEWS)
PAIRS = pairs_that_move(MATCHER)
OPPOSITE = {
    "inverse": "inverse", "OpenGL axes": "OpenGL axes", "LLFF axes": "axes turned as from LLFF",
    "axes turned as from LLFF": "LLFF axes", "unit x 1000": "unit / 1000", "unit / 1000": "unit x 1000",
    "one frame late": "one frame early", "one frame early": "one frame late",
    "quaternions w x y z": "quaternions x y z w", "quaternions x y z w": "quaternions w x y z",
    "reversed order": "reversed order",
}  # fmt: skip


def test_right_poses_fit():
    found = agreement(MATCHER, TRUE, PAIRS)
    assert found.verdict == "fits" and found.given < 0.5 * found.still, found.sentence


@pytest.mark.parametrize("wrong", readings(TRUE), ids=lambda reading: reading.name)
def test_a_misreading_is_named_with_its_remedy(wrong):
    found = agreement(MATCHER, wrong.poses, PAIRS)
    assert (found.verdict, found.reading) == ("misread", OPPOSITE[wrong.name])
    assert found.remedy and found.reading in found.sentence


def test_the_misreadings_above_are_tried():
    assert {reading.name for reading in readings(TRUE)} == set(OPPOSITE)


@pytest.mark.parametrize(("order", "name"), [([3, 0, 1, 2], "w x y z"), ([1, 2, 3, 0], "x y z w")])
def test_the_remedy_of_quaternions_names_the_order_of_the_file(order, name):
    """A file of w x y z, read as x y z w; and one of x y z w that was turned from w x y z once too often."""
    true = Rotation.random(5, random_state=1)
    read = Rotation.from_quat(true.as_quat()[:, order]).as_matrix()
    found = {one.name: one for one in readings([CameraPose(turn.T, np.zeros(3)) for turn in read])}
    undone = np.array([pose.rotation.T for pose in found[f"quaternions {name}"].poses])
    np.testing.assert_allclose(undone, true.as_matrix(), atol=1e-12)


def test_poses_of_another_path_are_wrong_without_a_remedy():
    rng = np.random.default_rng(0)
    order = rng.permutation(len(TRUE))
    found = agreement(MATCHER, [CameraPose(TRUE[k].rotation, TRUE[k].translation + 3) for k in order], PAIRS)
    assert found.verdict == "wrong" and "no usual misreading" in found.sentence


def test_equal_poses_and_pictures_that_do_not_move_are_not_judged():
    assert agreement(MATCHER, [TRUE[0]] * len(TRUE), PAIRS).verdict == "same"
    frozen = Views(*(np.repeat(plane[:1], 8, axis=0) for plane in VIEWS[:3]), VIEWS.camera)
    found = agreement(matcher_of(frozen), TRUE[:8])
    assert found.verdict == "not checked"


def test_a_scope_that_moves_and_one_that_does_not():
    moves = movement(PAIRS)
    assert moves.answer == "moving" and moves.left < 0.17, moves.sentence
    rests = movement(pairs_that_move(matcher_of(still_views())))
    assert rests.answer == "still" and "the scope is still" in rests.sentence
    few = movement(PAIRS[:2])
    assert few.answer == "unclear" and "cannot be told" in few.sentence


def test_without_depth_a_scope_is_never_called_still():
    one = np.ones_like(VIEWS.depth)
    assert drift(matcher_of(still_views()._replace(depth=one))).answer == "unclear"
    sliding = np.stack([np.roll(VIEWS.images[0], 3 * k, axis=2) for k in range(6)])
    slid = Views(sliding, VIEWS.tissue[:6], one[:6], VIEWS.camera)
    found = drift(matcher_of(slid))
    assert found.answer == "moving" and "the scope moves" in found.sentence
