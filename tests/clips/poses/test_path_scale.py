"""The scale of a reconstruction by the depth of a clip."""

import numpy as np
import pytest

from endotsr.clips.poses.path_scale import (
    LARGEST_INSIDE,
    LARGEST_SPREAD,
    LEAST_FRAMES,
    LEAST_POINTS,
    path_scale,
    scale_of,
)
from endotsr.clips.poses.structure import Structure
from endotsr.clips.poses.views import Views
from endotsr.method.splatting.camera import Camera, CameraPose

FRAMES, POINTS, SIDE = 10, 50, 40


def points_and_depth(factor):
    """Points in front of cameras that move sideways, at the centres of pixels, and depth that is `factor` times
    theirs."""
    rng = np.random.default_rng(0)
    camera = Camera(np.eye(3), np.zeros(3), 40.0, 40.0, SIDE / 2, SIDE / 2, SIDE, SIDE)
    depth = np.zeros((FRAMES, SIDE, SIDE), np.float32)
    points, seen, pixels, poses = [], [], [], []
    for k in range(FRAMES):
        place = rng.choice(SIDE * SIDE, POINTS, replace=False)
        at, z = np.stack([place % SIDE, place // SIDE], axis=1) + 0.5, rng.uniform(0.5, 2.0, POINTS)
        pose = CameraPose(np.eye(3), np.array([0.1 * k, 0.0, 0.02 * k]))
        points.append(np.column_stack([z[:, None] * (at - SIDE / 2) / 40.0, z]) - pose.translation)
        depth[k, place // SIDE, place % SIDE] = factor[k] * z
        seen.append(np.arange(k * POINTS, (k + 1) * POINTS))
        pixels.append(at)
        poses.append(pose)
    images, tissue = np.zeros((FRAMES, 3, SIDE, SIDE), np.uint8), np.ones((FRAMES, SIDE, SIDE), bool)
    found = Structure(poses, np.concatenate(points), seen, pixels, 0.0, [])
    return found, Views(images, tissue, depth, camera)


def test_the_scale_is_exact_for_one_scale():
    found, views = points_and_depth(np.full(FRAMES, 37.0))
    scale = scale_of(found, views)
    assert scale.told and scale.frames == FRAMES
    np.testing.assert_allclose(scale.factor, 37.0, rtol=1e-6)
    assert scale.spread < 1e-6 and scale.inside < 1e-6
    larger = found.scaled(scale.factor)
    np.testing.assert_allclose(larger.depth(3), 37.0 * found.depth(3))
    np.testing.assert_allclose(larger.poses[3].translation, 37.0 * found.poses[3].translation)


def test_a_scale_that_drifts_or_jumps_is_not_told():
    drifting, jumping = np.linspace(30, 45, FRAMES), np.where(np.arange(FRAMES) < 6, 30.0, 60.0)
    for factor in (drifting, jumping):
        scale = scale_of(*points_and_depth(factor))
        assert not scale.told and scale.spread > LARGEST_SPREAD and "cannot be told" in scale.sentence


def test_one_wrong_frame_in_ten_and_pixels_without_depth_do_no_harm():
    factor = np.full(FRAMES, 37.0)
    factor[4] = 90.0
    found, views = points_and_depth(factor)
    views.depth[:, :, ::2] = 0
    views.depth[0, ::3] = np.nan
    scale = scale_of(found, views)
    assert scale.told and scale.frames == FRAMES
    np.testing.assert_allclose(scale.factor, 37.0, rtol=1e-6)


def test_too_few_frames_with_depth_tell_no_scale():
    enough, few = np.full(LEAST_POINTS, 2.0), np.full(LEAST_POINTS - 1, 2.0)
    assert path_scale([enough] * LEAST_FRAMES).told
    scale = path_scale([enough] * (LEAST_FRAMES - 1) + [few] * 5)
    assert not scale.told and scale.frames == LEAST_FRAMES - 1 and "cannot be told" in scale.sentence


@pytest.mark.parametrize("shape", ["plane", "square of the depth"])
def test_the_points_of_a_frame_show_a_wrong_shape(shape):
    """A plane in place of the depth has a scale if the camera keeps its distance; the points of a frame disagree."""
    found, views = points_and_depth(np.ones(FRAMES))
    views.depth[...] = 1.0 if shape == "plane" else np.square(views.depth)
    scale = scale_of(found, views)
    assert scale.inside > LARGEST_INSIDE and not scale.told


def test_a_frame_without_a_pose_has_no_scale():
    found, views = points_and_depth(np.full(FRAMES, 5.0))
    none = np.zeros(0, np.intp)
    found = found._replace(poses=[None, *found.poses[1:]], seen=[none, *found.seen[1:]],
                           pixels=[np.zeros((0, 2)), *found.pixels[1:]])  # fmt: skip
    assert scale_of(found, views).frames == FRAMES - 1
