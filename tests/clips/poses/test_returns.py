"""Returns of the scope to a place that it has seen: found by features, and the drift of a chain spread over a loop."""

import cv2
import numpy as np
import pytest
from moving_clip import moving_views, path_error

from endotsr.clips.opencv.geometry import DISTINCT, Features, matched_features
from endotsr.clips.poses import bundle, returns
from endotsr.clips.poses.bundle import adjusted, pairs_of
from endotsr.clips.poses.levels import make_levels
from endotsr.clips.poses.matches import matcher_of
from endotsr.clips.poses.returns import Return, closed, difference, keyframes, returns_of
from endotsr.clips.poses.steps import moved
from endotsr.clips.poses.views import IDENTITY, Views, between, compose, inverse

DEPTH = 50.0


def drifted(poses, step):
    """The poses, with a step (6,) too much of motion at every frame."""
    found = [poses[0]]
    for k in range(1, len(poses)):
        found.append(moved(compose(between(poses, k - 1, k), found[-1]), step))
    return found


def circle(count):
    """Poses of a camera on a circle, which ends where it began."""
    turns = np.linspace(0, 2 * np.pi, count)
    return [moved(IDENTITY, np.array([0, 0.1 * np.sin(t), 0, 10 * np.cos(t), 10 * np.sin(t), 0])) for t in turns]


def test_a_loop_spreads_its_drift_evenly_over_the_frames():
    """There and back along a line: m motions and the return share m times the drift; 1 / (m + 1) of it is left at each.

    The graph of 400 frames has eigenvalues of 1e-4, which a diagonal that is too large would hide.
    """
    true = [IDENTITY._replace(translation=np.array([10 * np.sin(np.pi * k / 399), 0, 0])) for k in range(400)]
    drift = np.array([0, 0, 0, 0.05, 0, 0])
    found = closed(drifted(true, drift), [Return(0, 399, between(true, 0, 399), 100)], DEPTH)
    for k in range(399):
        left = difference(between(found, k, k + 1), between(true, k, k + 1))
        np.testing.assert_allclose(left, drift / 400, atol=1e-9)
    np.testing.assert_array_equal(np.column_stack(found[0]), np.column_stack(true[0]))


def test_a_loop_with_turns_ends_near_the_truth():
    true = circle(40)
    chain = drifted(true, np.array([0, 0, 0, 0.05, 0, 0]))
    found = closed(chain, [Return(0, 39, between(true, 0, 39), 100)], DEPTH)
    assert path_error(found, true) < 0.05 * path_error(chain, true)


def test_a_graph_without_contradiction_or_without_a_return_stays():
    true = circle(20)
    same = closed(true, [Return(2, 15, between(true, 2, 15), 100)], DEPTH)
    for one, other in zip(same, true, strict=True):
        np.testing.assert_allclose(np.column_stack(one), np.column_stack(other), atol=1e-12)
    assert closed(true, [], DEPTH) is true


def test_the_difference_is_the_step_between_two_poses():
    rng = np.random.default_rng(0)
    pose, step = moved(IDENTITY, rng.normal(size=6)), 0.1 * rng.normal(size=6)
    np.testing.assert_allclose(difference(moved(pose, step), pose), step, atol=1e-12)


@pytest.fixture(scope="module")
def scene():
    return moving_views()


@pytest.fixture
def near(monkeypatch):
    """Returns are looked for between all frames of a short clip."""
    monkeypatch.setattr(returns, "EVERY", 1)
    monkeypatch.setattr(returns, "LEAST_APART", 6)


def test_returns_have_the_motion_between_their_frames(scene, near):
    views, true = scene
    found = returns_of(matcher_of(views), true)
    assert len(found) >= 8 and all(one.target - one.source >= 6 for one in found)
    for one in found:
        wrong = compose(one.pose, inverse(between(true, one.source, one.target)))
        assert np.linalg.norm(wrong.translation) < 1.0, one  # mm, of tens that the camera moves
    assert max(sum(one.target == target for one in found) for target in range(14)) <= returns.MOST_RETURNS


def test_frames_without_a_pose_and_of_another_scene_have_no_return(scene, near):
    views, true = scene
    other, _ = moving_views(seed=3)
    mixed = Views(*(np.concatenate([a[:7], b[:7]]) for a, b in zip(views[:3], other[:3])), views.camera)
    found = returns_of(matcher_of(mixed), true)
    assert not [one for one in found if one.source < 7 <= one.target]
    assert returns_of(matcher_of(views), [true[0], *[None] * 13]) == []


def test_a_return_in_the_bundle_adjustment_takes_drift_away(scene, monkeypatch):
    """With pairs of successive frames alone, the adjustment drifts; one return over the clip holds it."""
    views, true = scene
    monkeypatch.setattr(bundle, "GAPS", (1,))
    monkeypatch.setattr(bundle, "pairs_of", lambda count: pairs_of(count, (1,)))
    levels, start = make_levels(views, (1, 0)), drifted(true, np.array([0, 0, 0, 0.03, 0.03, 0]))
    alone = adjusted(levels, start, DEPTH)
    held = adjusted(levels, start, DEPTH, returns=[(0, 13), (0, 10), (3, 13)])
    assert held.after.pairs == alone.after.pairs + 6
    assert path_error(held.poses, true) < 0.8 * path_error(alone.poses, true)


def test_keyframes_are_limited():
    assert keyframes(list(range(20))) == [0, 8, 16]
    assert keyframes([3, 4, 9]) == [3]
    assert len(keyframes(list(range(5000)))) <= returns.MOST_KEYS


def test_matches_are_those_of_opencv_by_brute_force():
    rng = np.random.default_rng(1)
    one = rng.integers(0, 180, (300, 128)).astype(np.float32)
    other = np.clip(one[rng.permutation(300)][:250] + rng.integers(-60, 60, (250, 128)), 0, 255).astype(np.float32)
    here, there = matched_features(*(Features(np.zeros((len(d), 2)), d) for d in (one, other)))
    matcher = cv2.BFMatcher(cv2.NORM_L2, crossCheck=False)
    back = {match.queryIdx: match.trainIdx for match in matcher.match(other, one)}
    wanted = {
        (first.queryIdx, first.trainIdx)
        for first, second in matcher.knnMatch(one, other, 2)
        if first.distance < DISTINCT * second.distance and back[first.trainIdx] == first.queryIdx
    }
    assert set(zip(here.tolist(), there.tolist())) == wanted and len(wanted) > 100
