"""The direct bundle adjustment: poses from the residuals of pairs of frames."""

import numba
import numpy as np
import pytest
from moving_clip import moving_views, path_error

from endotsr.clips.poses import bundle
from endotsr.clips.poses.bundle import adjusted, fit_of, pairs_of
from endotsr.clips.poses.levels import make_levels, normalised
from endotsr.clips.poses.pair_kernels import COST, RIGHT
from endotsr.clips.poses.steps import adjoint, normal_equations
from endotsr.clips.poses.views import compose, inverse
from endotsr.method.equations.pose import pose_forward
from endotsr.method.splatting.camera import CameraPose

DEPTH = 50.0


def moved(pose, size, rng):
    turn, shift, _ = pose_forward(*pose, rng.normal(0, size / DEPTH, 3), rng.normal(0, size, 3))
    return CameraPose(turn, shift)


@pytest.fixture(scope="module")
def scene():
    views, true = moving_views()
    rng = np.random.default_rng(0)
    return make_levels(views, (1, 0)), true, [true[0], *(moved(pose, 0.3, rng) for pose in true[1:])]


@pytest.fixture(scope="module")
def found(scene):
    levels, _, start = scene
    return adjusted(levels, start, DEPTH)


def test_disturbed_poses_come_back(scene, found):
    _, true, start = scene
    assert path_error(start, true) > 0.4
    assert path_error(found.poses, true) < 0.12
    assert found.after.scale < 0.5 * found.before.scale and found.after.agreeing > 0.8


def test_a_step_that_does_not_lower_the_cost_is_not_taken(scene, monkeypatch):
    levels, _, start = scene
    monkeypatch.setattr(bundle, "solved_step", lambda sums, pairs, poses, depth, damping: np.full((len(poses), 6), 0.5))
    found = adjusted(levels, start, DEPTH)
    assert found.after.steps == 0
    for one, other in zip(found.poses, start, strict=True):
        np.testing.assert_array_equal(one.translation, other.translation)


def test_the_same_bits_for_one_and_two_threads(scene, found):
    levels, _, start = scene
    before = numba.get_num_threads()
    try:
        for threads in {1, min(2, numba.config.NUMBA_NUM_THREADS)} - {before}:
            numba.set_num_threads(threads)
            for one, other in zip(adjusted(levels, start, DEPTH).poses, found.poses, strict=True):
                np.testing.assert_array_equal(np.column_stack(one), np.column_stack(other))
    finally:
        numba.set_num_threads(before)


def test_the_normal_equations_are_the_derivative_of_the_cost(scene):
    """The right side against differences of the cost, for both frames of a pair."""
    levels, _, start = scene
    pairs = np.array([[2, 4]], np.intp)
    kept, scale = bundle.pair_scales(levels[1], pairs, start)
    unit = np.array([1, 1, 1, DEPTH, DEPTH, DEPTH])
    sums = bundle.pair_sums(levels[1], kept, scale, start)
    _, right = normal_equations(sums, kept, start, unit)
    assert sums.shape == (1, 30) and RIGHT == 21
    for frame in (2, 4):
        for k in range(6):
            costs = []
            for sign in (1, -1):
                step = sign * 1e-6 * unit * (np.arange(6) == k)
                poses = list(start)
                poses[frame] = CameraPose(*pose_forward(*start[frame], step[:3], step[3:])[:2])
                costs.append(bundle.pair_sums(levels[1], kept, scale, poses)[0, COST])
            np.testing.assert_allclose((costs[0] - costs[1]) / 2e-6, right[6 * frame + k], rtol=2e-3, atol=0.5)


def test_the_adjoint_moves_a_change_to_the_other_frame():
    rng = np.random.default_rng(3)
    first, second = (moved(CameraPose(np.eye(3), np.zeros(3)), 5.0, rng) for _ in range(2))
    xi = 1e-6 * rng.normal(size=6)
    changed = CameraPose(*pose_forward(*first, xi[:3], xi[3:])[:2])
    relative = compose(second, inverse(first))
    change = -adjoint(relative) @ xi
    for one, other in zip(compose(second, inverse(changed)), pose_forward(*relative, change[:3], change[3:])[:2]):
        np.testing.assert_allclose(one, other, atol=1e-10)


def test_pairs_have_both_directions_and_the_gaps():
    pairs = {tuple(pair) for pair in pairs_of(20).tolist()}
    assert {abs(a - b) for a, b in pairs} == {1, 4, 16}
    assert {(b, a) for a, b in pairs} == pairs
    starts = {gap: sorted(a for a, b in pairs_of(40).tolist() if b - a == gap) for gap in (1, 4, 16)}
    assert starts == {1: [*range(39)], 4: [*range(0, 36, 2)], 16: [0, 8, 16]}, "a gap begins at every frame, 2nd, 8th"
    assert pairs_of(1).shape == (0, 2)


def test_without_an_overlap_the_poses_stay(scene):
    levels, true, _ = scene
    far = [CameraPose(pose.rotation, pose.translation + 1e4 * k) for k, pose in enumerate(true)]
    found = adjusted(levels, far, DEPTH)
    assert found.after.pairs == 0 and np.isnan(found.after.scale)
    np.testing.assert_array_equal(found.poses[3].translation, far[3].translation)
    assert fit_of(levels[1], pairs_of(len(true)), true).pairs > 0


def test_light_and_what_is_masked_leave_the_normalised_picture():
    """Gain and offset cancel where the contrast is not faint; pixels outside the mask do not matter."""
    rng = np.random.default_rng(1)
    grey = (100 + 40 * rng.normal(size=(40, 50))).astype(np.float32)
    mask = np.ones((40, 50), bool)
    mask[:, 30:] = False
    found = normalised(grey, mask)
    brighter = normalised(2 * grey + 7, mask)
    np.testing.assert_allclose(found[:, :30], brighter[:, :30], rtol=0.03, atol=0.03)
    tool = grey.copy()
    tool[:, 30:] = 255
    np.testing.assert_allclose(normalised(tool, mask)[:, :30], found[:, :30], rtol=1e-4, atol=1e-4)
