"""True trajectories: a material point is where the surface formula, the depth map and the flow say."""

import numpy as np
import pytest

from endotsr.clips.simulator import EFFECTS, SimulatorSettings, simulate, with_effects
from endotsr.clips.simulator.trajectories import material_at, material_tracks

SETTINGS = with_effects(SimulatorSettings(width=48, height=40, frames=6, seed=3), *EFFECTS)


@pytest.fixture(scope="module")
def scene():
    return simulate(SETTINGS)


@pytest.fixture(scope="module")
def centres():
    rows, columns = np.mgrid[2:38:4, 3:45:5]
    return rows.ravel(), columns.ravel()


@pytest.mark.parametrize("frame", [0, 4])
def test_the_point_at_a_pixel_centre_is_the_stored_one(scene, centres, frame):
    rows, columns = centres
    found = material_at(scene, np.stack([columns + 0.5, rows + 0.5]), frame)
    np.testing.assert_allclose(found, scene.truth.material_coordinates[frame][:, rows, columns], atol=1e-9)


def test_tracks_follow_the_true_flow(scene, centres):
    rows, columns = centres
    tracks = material_tracks(scene, material_at(scene, np.stack([columns + 0.5, rows + 0.5]), 1))
    flow = scene.true_flow(1, 5)[:, rows, columns]
    np.testing.assert_allclose(tracks.pixel[5] - tracks.pixel[1], flow, atol=1e-7)
    assert np.hypot(*flow).max() > 1


def test_positions_are_those_of_the_formula_and_project_to_the_pixels(scene):
    material = np.array([[-8.0, 0.5, 6.0], [3.0, -2.0, 7.0]])
    tracks = material_tracks(scene, material)
    for i, camera in enumerate(scene.sequence.cameras):
        np.testing.assert_array_equal(tracks.position[i], scene.surface_point(material, scene.sequence.times[i]))
        x, y, z = camera.rotation @ tracks.position[i] + camera.translation[:, None]
        np.testing.assert_allclose(tracks.pixel[i], [camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])
        np.testing.assert_allclose(tracks.depth[i], z)


def test_a_point_is_visible_where_the_picture_shows_it(scene, centres):
    rows, columns = centres
    beyond = np.array([[-900.0, 900.0, 0.0, 0.0], [0.0, 0.0, -900.0, 900.0]])
    material = np.concatenate([material_at(scene, np.stack([columns + 0.5, rows + 0.5]), 3), beyond], axis=1)
    visible = material_tracks(scene, material).visible[3]
    wound = np.isnan(scene.truth.material_coordinates[3]).any(axis=0)[rows, columns]
    np.testing.assert_array_equal(visible[:-4], ~scene.truth.instrument[3][rows, columns] & ~wound)
    assert not visible[-4:].any() and wound.any() and 0 < visible[:-4].sum() < len(rows)


def test_no_points_and_frames_that_do_not_exist(scene):
    tracks = material_tracks(scene, np.zeros((2, 0)))
    assert tracks.position.shape == (6, 3, 0) and tracks.visible.shape == (6, 0)
    with pytest.raises(IndexError, match="frame 6 of a sequence of 6"):
        material_at(scene, np.zeros((2, 1)), 6)
    with pytest.raises(IndexError):
        material_at(scene, np.zeros((2, 1)), -1)
