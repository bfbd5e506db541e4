"""A moving camera: what a rigid scene explains is no motion of the tissue, and what it does not explain is."""

from dataclasses import replace

import numpy as np
import pytest
from pages.effects.study import settings_of
from pages.recordings.hand_held_clips import recorded
from scenes import clip

from data_folder import data_folder
from endotsr.clips.effects.frames import TILE, reduced_frames
from endotsr.clips.effects.motion import motion_verdict
from endotsr.clips.effects.noise import estimate_noise
from endotsr.clips.effects.rigid import fit_rigid, inverse_depth, predicted_flow
from endotsr.clips.effects.tracks import make_tracks
from endotsr.clips.simulator.simulate import simulate

pytestmark = pytest.mark.slow

SWING = 3.0  # mm


def _motion(sequence):
    found = reduced_frames(sequence)
    noise = estimate_noise(sequence, found)
    return motion_verdict(sequence, found, make_tracks(found, noise), noise)[0]


def test_inverse_depth_of_resting_points_is_found_exactly():
    """Also where frames do not see them, and for a point without an end: its inverse depth is 0."""
    found = reduced_frames(clip("noise", "camera_motion", amplitude=9.0))
    rng = np.random.default_rng(0)
    place = rng.uniform(10, 110, (2, 40))
    inverse = np.append(1 / rng.uniform(30, 80, 39), 0.0)
    flow = predicted_flow(found, place, inverse)
    assert np.abs(flow[found.reference]).max() < 1e-9
    flow[::3, :, ::2] = np.nan
    np.testing.assert_allclose(inverse_depth(found, place, flow), inverse, rtol=1e-6, atol=1e-12)


def test_predicted_flow_is_that_of_the_simulated_tissue():
    made = simulate(settings_of(("noise", "camera_motion"), 0, 9, 5.0))
    found = reduced_frames(made.sequence)
    train = made.sequence.train_index
    middle = int(train[found.reference])
    row, column = 40, 70
    depth = made.truth.depth[middle, row, column]
    flow = predicted_flow(found, np.array([[column + 0.5], [row + 0.5]]), np.array([1 / depth]))[:, :, 0]
    true = np.array([made.true_flow(middle, int(i))[:, row, column] for i in train])
    assert np.abs(true).max() > 0.2
    np.testing.assert_allclose(flow, true, atol=1e-9)


def test_a_resting_scene_needs_no_depth():
    sequence = clip("noise", "camera_motion", amplitude=SWING)
    verdict = _motion(replace(sequence, depth=np.zeros_like(sequence.depth)))
    assert verdict.kind == "none" and verdict.statistic < 0.8


@pytest.mark.parametrize("effect", ["breathing", "pulsation", "pull"])
def test_tissue_that_moves_before_a_moving_camera_is_found(effect):
    assert _motion(clip("noise", effect, "camera_motion", frames=16, amplitude=SWING)).present


def _behind_a_round_stop(sequence, rim):
    """Black outside a circle, which the mask excludes, and with a bright rim inside it."""
    height, width = sequence.images.shape[2:]
    y, x = np.indices((height, width))
    radius = np.hypot(y - 0.5 * height, x - 0.5 * width) / (0.48 * height)
    images = np.where(radius < 1, sequence.images, 0)
    images = np.where((radius > 1 - rim) & (radius < 1), 255, images).astype(np.uint8)
    return replace(sequence, images=images, masks=sequence.masks & (radius < 1))


@pytest.mark.parametrize("rim", [0.0, 0.05])
def test_the_border_of_a_round_field_of_view_is_no_motion(rim):
    """The border rests in the picture while the tissue passes behind it."""
    resting = clip("noise", "camera_motion", amplitude=9.0, frames=16)
    assert not _motion(_behind_a_round_stop(resting, rim)).present


def test_tiles_beside_excluded_pixels_are_left_out():
    sequence = clip("noise", "camera_motion", amplitude=SWING)
    masks = sequence.masks.copy()
    masks[:, 40:44, 72:76] = False
    changed = reduced_frames(replace(sequence, masks=masks))
    noise = estimate_noise(sequence, changed)
    clear = fit_rigid(changed, make_tracks(changed, noise), noise).clear.reshape(128 // TILE, 160 // TILE)
    assert not clear[0].any() and not clear[:, -1].any()  # the edge of the picture
    assert not clear[2:4, 4:6].any()  # pixels 32 to 51 and 64 to 83 are within 8 of an excluded one
    assert clear[1, 1:-1].all() and clear[4:-1, 1:-1].all() and clear[2:4, 1:4].all() and clear[2:4, 6:-1].all()


def test_flow_that_does_not_return_counts_as_noise():
    """Frames that show something else have no flow; their tiles do not move."""
    sequence = clip("noise", "camera_motion", amplitude=SWING)
    images = sequence.images.copy()
    rng = np.random.default_rng(3)
    images[:, :, 32:96, 32:128] = rng.integers(60, 200, images[:, :, 32:96, 32:128].shape, dtype=np.uint8)
    changed = reduced_frames(replace(sequence, images=images))
    noise = estimate_noise(sequence, changed)
    tracks = make_tracks(changed, noise)
    inside = (slice(3, 5), slice(3, 7))
    error = fit_rigid(changed, tracks, noise).error.reshape(128 // TILE, 160 // TILE)
    assert error[inside].min() > 0.3
    plain = reduced_frames(sequence)
    error = fit_rigid(plain, make_tracks(plain, noise), noise).error.reshape(128 // TILE, 160 // TILE)
    assert error[inside].max() < 0.15


def test_the_rigid_anatomy_of_a_real_clip_does_not_move():
    """35 frames of a nose, the camera moves: the size of the flow is 20 pixels."""
    folder = data_folder("sinus_endoscopy")
    verdict = _motion(recorded(folder.name, folder.parent, "0.33333"))
    assert verdict.kind == "none"
