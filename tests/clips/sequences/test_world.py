"""The world frame: identity near the origin, moved and scaled where float32 or the settings would not suffice."""

import numpy as np
import pytest
from common_folder import moving, written

from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.world import USUAL_DEPTH, World, fitting_world, moved_camera
from endotsr.config import SequenceConfig
from endotsr.method.splatting.camera import Camera, backproject, camera_centre
from synthetic_folder import identity_rows, write_synthetic_folder

WHOLE = SequenceConfig(depth_percentiles=(0.0, 100.0))
DEPTH = np.full((1, 4, 4), 50.0, np.float32)


def test_near_the_origin_nothing_changes(tmp_path):
    written(tmp_path, poses=moving())
    sequence = read_sequence(tmp_path, WHOLE, 0.2)
    assert not any("world" in note for note in sequence.notes)
    for i, camera in enumerate(sequence.cameras):
        assert camera.translation.tolist() == [-2.0 * i, 0.0, 0.0]


@pytest.mark.parametrize("offset", [(1e9, 0.0, 0.0), (-3e6, 2e9, 1e5)])
def test_a_camera_far_away_is_read_like_one_at_the_origin(tmp_path, offset):
    """Offsets that float64 holds exactly together with steps of 2 mm."""
    written(tmp_path / "near", poses=moving())
    written(tmp_path / "far", poses=moving(offset))
    near, far = (read_sequence(tmp_path / name, WHOLE, 0.2) for name in ("near", "far"))
    assert any("world: scene" in note for note in far.notes)
    apart = [camera_centre(b) - camera_centre(a) for a, b in zip(near.cameras, far.cameras)]
    assert np.ptp(apart, axis=0).max() == 0  # the same motion, exactly
    assert max(np.abs(camera_centre(camera)).max() for camera in far.cameras) <= 4.0
    np.testing.assert_array_equal(near.depth, far.depth)


def test_an_endonerf_folder_far_away_too(tmp_path):
    rows = identity_rows(5, 32, 24)
    rows[:, 3] = 1e9 + np.arange(5.0)
    write_synthetic_folder(tmp_path, rows=rows)
    sequence = read_sequence(tmp_path, WHOLE)
    assert [camera_centre(c)[0] for c in sequence.cameras] == [-2.0, -1.0, 0.0, 1.0, 2.0]


def test_an_arbitrary_unit_is_scaled_to_the_usual_depth(tmp_path):
    found = written(tmp_path, poses=moving(step=0.02), unit="arbitrary")
    assert found.depth
    file = tmp_path / "sequence.toml"
    text = file.read_text().replace(
        '[depth]\nfolder = "depth"\nunit = "mm"', '[depth]\nfolder = "depth"\nunit = "arbitrary"'
    )
    file.write_text(text.replace("scale = 0.01", "scale = 0.0001"))
    sequence = read_sequence(tmp_path, WHOLE, 0.2)
    assert np.median(sequence.depth[sequence.depth > 0]) == pytest.approx(USUAL_DEPTH, rel=0.02)
    step = camera_centre(sequence.cameras[1])[0] - camera_centre(sequence.cameras[0])[0]
    scale = sequence.depth.max() / 0.5999
    assert step == pytest.approx(0.02 * scale, rel=1e-3)


def test_a_moved_camera_sees_moved_points_in_the_same_place():
    rotation = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    camera = Camera(
        rotation * np.sign(np.linalg.det(rotation)), np.array([1.0, 2.0, 3.0]), 30.0, 31.0, 9.0, 8.0, 20, 16
    )
    world = World(np.array([4.0, -5.0, 6.0]), 2.5)
    place = tuple(np.array([value]) for value in (3.0, 7.0, 40.0))
    before = backproject(camera, *place)[:, 0]
    moved = backproject(moved_camera(camera, world), place[0], place[1], place[2] * world.scale)[:, 0]
    np.testing.assert_allclose(moved, (before - world.origin) * world.scale, rtol=1e-12)


def test_without_depth_the_world_stays():
    assert fitting_world(np.array([[1e9, 0, 0]]), DEPTH * 0, arbitrary=True).unchanged


def test_a_long_way_of_the_camera_alone_is_no_reason(tmp_path):
    assert fitting_world(np.array([[0.0, 0, 0], [400.0, 0, 0]]), DEPTH, arbitrary=False).unchanged
    assert not fitting_world(np.array([[0.0, 0, 0], [40000.0, 0, 0]]), DEPTH, arbitrary=False).unchanged
