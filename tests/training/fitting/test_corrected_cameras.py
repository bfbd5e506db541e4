"""Cameras with the correction of their poses: made-up parameters, no training."""

import numpy as np
import pytest

from endotsr.method.equations.pose import pose_forward, pose_reverse
from endotsr.method.splatting.camera import CameraGrads
from endotsr.training.fitting.model import (
    camera_at,
    corrected_cameras,
    with_corrected_cameras,
    with_pose_correction,
    with_pose_correction_reverse,
)
from endotsr.training.scene.parameters import FrameParameters, Pose, pose_at
from endotsr.training.scene.workload import sequence as made_up_sequence


@pytest.fixture(scope="module")
def clip():
    return made_up_sequence(24, 16, frames=6)


@pytest.fixture
def frames(clip):
    rng = np.random.default_rng(5)
    times = clip.times[clip.train_index]
    return FrameParameters(times, None, None, *rng.normal(0, 0.2, (2, 3, times.size)))


def test_every_camera_has_the_correction_at_its_time(clip, frames):
    found = corrected_cameras(frames, clip.cameras, clip.times)
    assert len(found) == clip.count
    for camera, given, t in zip(found, clip.cameras, clip.times, strict=True):
        pose = pose_at(frames, float(t))
        rotation, translation, _ = pose_forward(given.rotation, given.translation, *pose)
        np.testing.assert_array_equal(camera.rotation, rotation)
        np.testing.assert_array_equal(camera.translation, translation)
        assert camera[2:] == given[2:]
    np.testing.assert_array_equal(camera_at(frames, clip.cameras[1], 0.3).rotation,
                                  with_pose_correction(clip.cameras[1], pose_at(frames, 0.3))[0].rotation)  # fmt: skip


def test_without_corrections_nothing_is_made_anew(clip):
    for none in (None, FrameParameters(clip.times[clip.train_index])):
        assert with_corrected_cameras(clip, none) is clip
        assert all(a is b for a, b in zip(corrected_cameras(none, clip.cameras, clip.times), clip.cameras, strict=True))
    assert with_pose_correction(clip.cameras[0], None) == (clip.cameras[0], None)


def test_a_sequence_keeps_everything_but_its_cameras(clip, frames):
    seen = with_corrected_cameras(clip, frames)
    assert seen is not clip and seen.images is clip.images and seen.masks is clip.masks
    assert not np.array_equal(seen.cameras[0].rotation, clip.cameras[0].rotation)


def test_gradients_go_back_to_the_correction_alone_and_only_where_there_is_one(clip):
    camera, grads = clip.cameras[0], CameraGrads(np.arange(9.0).reshape(3, 3), np.array([1.0, -2.0, 3.0]))
    _, saved = with_pose_correction(camera, Pose(np.array([0.1, 0.2, -0.3]), np.array([1.0, 2.0, 3.0])))
    found, wanted = with_pose_correction_reverse(grads, saved), pose_reverse(*grads, saved)
    np.testing.assert_array_equal(found.rotation, wanted.d_rotation_vector)
    np.testing.assert_array_equal(found.translation, wanted.d_offset)
    assert with_pose_correction_reverse(None, saved) is None
    assert with_pose_correction_reverse(grads, None) is None
    assert with_pose_correction_reverse(None, None) is None
