"""Parameters of frames: identity at the start, nothing where they are off, interpolation in time."""

import numpy as np
import pytest

from endotsr.config import ModelConfig
from endotsr.training.scene.parameters import (
    Exposure,
    FrameParameters,
    Pose,
    exposure_at,
    exposure_gradients,
    exposure_of,
    frame_parameters,
    pose_at,
    pose_gradients,
    trained,
)

TIMES = np.array([0.0, 0.2, 0.3, 0.7])


@pytest.fixture
def frames():
    rng = np.random.default_rng(4)
    return FrameParameters(TIMES, *rng.normal(size=(4, 3, 4)))


def test_off_is_nothing_at_all_and_on_is_the_identity():
    assert frame_parameters(ModelConfig(), TIMES, "float32") is None
    assert trained(None) == {} and exposure_of(None, 0) is None and exposure_at(None, 0.5) is None
    on = frame_parameters(ModelConfig(exposure=True), TIMES, "float32")
    assert on is not None and set(trained(on)) == {"exposure_log_gain", "exposure_bias"}
    assert all(a.shape == (3, 4) and a.dtype == np.float32 and not a.any() for a in trained(on).values())
    assert exposure_at(FrameParameters(TIMES), 0.1) is None and exposure_of(FrameParameters(TIMES), 1) is None
    assert pose_at(None, 0.5) is None and pose_at(on, 0.1) is None
    poses = frame_parameters(ModelConfig(pose_correction=True), TIMES, "float64")
    assert poses is not None and set(trained(poses)) == {"pose_rotation", "pose_translation"}
    assert exposure_at(poses, 0.1) is None and exposure_of(poses, 1) is None
    assert all(a.shape == (3, 4) and a.dtype == np.float64 and not a.any() for a in trained(poses).values())


def at_time(t, values):
    """Linear between the neighbours of t among TIMES, constant beyond the ends."""
    if t <= TIMES[0]:
        return values[0]
    for left in range(len(TIMES) - 1):
        if t <= TIMES[left + 1]:
            part = (t - TIMES[left]) / (TIMES[left + 1] - TIMES[left])
            return values[left] + part * (values[left + 1] - values[left])
    return values[-1]


@pytest.mark.parametrize("t", [-1.0, 0.0, 0.13, 0.2, 0.55, 0.7, 0.99])
def test_parameters_at_a_time_are_linear_between_the_neighbours(frames, t):
    found = (*exposure_at(frames, t), *pose_at(frames, t))
    for row, array in zip(found, trained(frames).values(), strict=True):
        expected = [at_time(t, channel) for channel in array.tolist()]
        np.testing.assert_allclose(row, expected, rtol=1e-14, atol=1e-15)  # values of about 1


def test_at_the_time_of_a_training_frame_the_exposure_is_that_of_the_frame(frames):
    for k, t in enumerate(TIMES):
        for one, other in zip(exposure_at(frames, float(t)), exposure_of(frames, k), strict=True):
            np.testing.assert_array_equal(one, other)


def test_only_the_column_of_the_frame_has_a_gradient(frames):
    gradients = exposure_gradients(frames, 2, Exposure(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])))
    assert gradients["exposure_log_gain"].tolist() == [[0, 0, k, 0] for k in (1, 2, 3)]
    assert gradients["exposure_bias"].tolist() == [[0, 0, k, 0] for k in (4, 5, 6)]


@pytest.mark.parametrize("t", [-1.0, 0.0, 0.13, 0.2, 0.55, 0.7, 0.99])
def test_gradients_by_the_poses_are_the_transpose_of_their_interpolation(frames, t):
    given = Pose(np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.25, -4.0]))
    gradients = pose_gradients(frames, t, given)
    left = sum(float(vector @ found) for vector, found in zip(given, pose_at(frames, t), strict=True))
    right = sum(float((gradients[name] * getattr(frames, name)).sum()) for name in gradients)
    assert gradients.keys() == {"pose_rotation", "pose_translation"}
    assert left == pytest.approx(right, rel=1e-12)


def test_a_single_frame_takes_the_whole_gradient_at_any_time():
    one = FrameParameters(np.array([0.3]), None, None, np.ones((3, 1)), np.zeros((3, 1)))
    assert pose_at(one, 0.9).rotation.tolist() == [1, 1, 1]
    assert pose_gradients(one, 0.9, Pose(np.arange(3.0), np.ones(3)))["pose_rotation"].tolist() == [[0], [1], [2]]
