"""A camera that a hand holds: where it is, how it turns, and that nothing else changes."""

import msgspec
import numpy as np
import pytest

from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects
from endotsr.clips.simulator.cameras import camera_centres, make_cameras
from endotsr.clips.simulator.field_of_view import check_field_of_view
from endotsr.config import with_settings
from endotsr.errors import InputError

TIMES = np.linspace(0, 1, 401)
SMALL = with_effects(SimulatorSettings(width=48, height=40, frames=6), "camera_motion")


def hand(seed=0, **values):
    settings = msgspec.structs.replace(SMALL, seed=seed)
    return with_settings(settings, camera_motion={"path": "hand", "amplitude": 8.0} | values)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_it_starts_at_rest_and_reaches_the_amplitude(seed):
    centres, first = camera_centres(hand(seed), TIMES), make_cameras(hand(seed), TIMES)[0]
    np.testing.assert_array_equal(centres[0], 0)
    np.testing.assert_allclose(first.rotation, np.eye(3), atol=1e-15)
    assert np.hypot(*centres[:, :2].T).max() == pytest.approx(8.0, rel=1e-3)
    np.testing.assert_allclose(camera_centres(hand(seed, amplitude=4.0), TIMES), centres / 2, atol=1e-12)
    assert not camera_centres(hand(seed, amplitude=0.0), TIMES).any()


def test_all_six_degrees_of_freedom_move_and_seeds_differ():
    cameras = make_cameras(hand(), TIMES)
    roll = [np.arctan2(camera.rotation[0, 1], camera.rotation[0, 0]) for camera in cameras]
    assert 0.3 * 0.4 * 8 / 50 < np.ptp(roll) < 3 * 0.4 * 8 / 50
    assert np.ptp(camera_centres(hand(), TIMES), axis=0).min() > 1
    forward = np.array([camera.rotation[2] for camera in cameras])
    assert np.ptp(forward[:, :2], axis=0).min() > 0.02
    assert np.abs(camera_centres(hand(1), TIMES) - camera_centres(hand(), TIMES)).max() > 2
    for camera in cameras[::50]:
        np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), atol=1e-12)


def test_twice_the_cycles_is_the_same_path_twice_as_fast():
    slow, fast = camera_centres(hand(), TIMES), camera_centres(hand(cycles=2.0, amplitude=1.0), TIMES / 2)
    scale = slow[50] @ slow[50] / (fast[50] @ slow[50])
    np.testing.assert_allclose(scale * fast, slow, atol=1e-9)


def test_the_scene_is_that_of_the_orbit():
    found, orbit = (simulate(with_settings(hand(3), camera_motion={"path": path})) for path in ("hand", "orbit"))
    np.testing.assert_array_equal(found.sequence.images[0], orbit.sequence.images[0])
    assert (found.sequence.images[3] != orbit.sequence.images[3]).any() and not found.sequence.static_camera


def test_a_path_beyond_the_tissue_is_refused():
    with pytest.raises(InputError, match=r"camera_motion.amplitude = 60 leaves .* use at most"):
        check_field_of_view(hand(amplitude=60.0))
