"""Camera paths: the pivot stays, a path closes, and a file of cameras is checked."""

import json

import numpy as np
import pytest

from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, camera_centre, degrees_between
from endotsr.results.views.cameras import along, fitted, path_cameras, pivot_depth_of, read_cameras, shifted, turned

CAMERA = Camera(np.eye(3), np.array([0.1, -0.2, 0.3]), 50.0, 52.0, 31.0, 24.5, 64, 48)


def seen(camera, point):
    """Column, row and depth of a world point."""
    x, y, z = camera.rotation @ point + camera.translation
    return np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, z])


@pytest.mark.parametrize(("yaw", "pitch"), [(0.2, 0.0), (0.0, -0.3), (0.4, 0.5)])
def test_a_turn_keeps_the_pivot_in_place(yaw, pitch):
    pivot = np.array([0.0, 0.0, 7.0]) - CAMERA.translation
    moved = turned(CAMERA, yaw, pitch, 7.0)
    assert np.allclose(seen(moved, pivot), seen(CAMERA, pivot)) and not np.allclose(moved.rotation, CAMERA.rotation)
    assert np.allclose(moved.rotation @ moved.rotation.T, np.eye(3)) and np.linalg.det(moved.rotation) > 0


def test_the_signs_of_a_turn_are_those_of_its_words():
    right, down = (
        camera_centre(turned(CAMERA, *angles, 7.0)) - camera_centre(CAMERA) for angles in ((0.1, 0), (0, 0.1))
    )
    assert right[0] > 0.1 and abs(right[1]) < 1e-12 and down[1] > 0.1 and abs(down[0]) < 1e-12


def test_an_offset_moves_the_optical_centre_along_the_axes_of_the_camera():
    quarter = CAMERA._replace(rotation=np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    moved = shifted(quarter, (2.0, 0.0, 1.0))
    assert np.allclose(camera_centre(moved) - camera_centre(quarter), quarter.rotation.T @ [2.0, 0.0, 1.0])


@pytest.mark.parametrize("size", [(128, 96), (128, 48), (32, 100)])
def test_another_size_keeps_pixels_square_and_the_view_inside(size):
    camera = fitted(CAMERA, *size)
    assert camera.fx / camera.fy == pytest.approx(CAMERA.fx / CAMERA.fy) and (camera.width, camera.height) == size
    corners = [
        np.array([(c - CAMERA.cx) / CAMERA.fx, (r - CAMERA.cy) / CAMERA.fy, 1]) for c in (0, 64) for r in (0, 48)
    ]
    for corner in corners:
        column, row, _ = seen(camera, corner - CAMERA.translation)
        assert -1e-9 <= column <= size[0] + 1e-9 and -1e-9 <= row <= size[1] + 1e-9
    left, right = (seen(camera, [(c - CAMERA.cx) / CAMERA.fx, 0, 1] - CAMERA.translation)[0] for c in (0, 64))
    assert left + right == pytest.approx(size[0]), "in the middle"
    assert fitted(CAMERA, 64, 48) == CAMERA


def test_paths_close_and_observed_is_the_camera_itself():
    cameras = [CAMERA] * 8
    assert path_cameras("observed", cameras, 8, 5.0) == cameras
    sway = path_cameras("sway", cameras, 8, 5.0)
    assert np.allclose(sway[0].rotation, np.eye(3)) and np.allclose(sway[4].rotation, np.eye(3))
    orbit = np.array([camera_centre(c) for c in path_cameras("orbit", cameras, 8, 5.0)])
    steps = np.linalg.norm(np.diff(orbit, axis=0, append=orbit[:1]), axis=1)
    assert steps.min() > 0.8 * steps.max() > 0


def test_the_pivot_is_the_median_depth_of_what_is_opaque():
    depth, opacity = np.array([[4.0, 3.0, 0.1]]), np.array([[0.8, 1.0, 0.01]])
    assert pivot_depth_of(depth, opacity) == 4.0 and pivot_depth_of(depth, opacity * 0) == 1.0


def write(tmp_path, *cameras):
    file = tmp_path / "path.json"
    file.write_text(json.dumps({"cameras": list(cameras)}))
    return file


GOOD = {"rotation": np.eye(3).tolist(), "translation": [1, 2, 3]}


def test_cameras_of_a_file_take_what_they_do_not_name_from_the_sequence(tmp_path):
    first, second = read_cameras(write(tmp_path, GOOD, GOOD | {"fx": 99.0, "width": 10}), CAMERA)
    assert (first.fx, first.width, list(first.translation)) == (50.0, 64, [1, 2, 3])
    assert (second.fx, second.fy, second.width) == (99.0, 52.0, 10)


@pytest.mark.parametrize(("camera", "said"), [
    ({"translation": [1, 2, 3]}, "cameras[0]: its content: object missing required field `rotation`"),
    (GOOD | {"rotation": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "rotation: the first three columns are not perp"),
    (GOOD | {"rotation": np.diag([1.0, 1, -1]).tolist()}, "rotation: the first three columns are a mirror image"),
    (GOOD | {"translation": [1, 2]}, "translation: expected `array` of length 3, got 2"),
    (GOOD | {"translation": [1, 2, "x"]}, "translation"),
    (GOOD | {"fx": -3}, "fx: expected `float` > 0.0"),
    (GOOD | {"fx": [1]}, "fx: expected `float`, got `array`"),
    (GOOD | {"width": 1e9}, "width: expected `int`"),
    (GOOD | {"focal": 3}, "object contains unknown field `focal`"),
    (7, "cameras[0]: int"),
])  # fmt: skip
def test_cameras_that_cannot_be_used_are_refused(camera, said, tmp_path):
    with pytest.raises(InputError) as refused:
        read_cameras(write(tmp_path, camera), CAMERA)
    assert said in str(refused.value) and "path.json" in str(refused.value)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"cameras": []}', '{"cameras": 3}'])
def test_a_file_without_cameras_is_refused(content, tmp_path):
    (tmp_path / "path.json").write_text(content)
    with pytest.raises(InputError, match=r"path\.json"):
        read_cameras(tmp_path / "path.json", CAMERA)
    with pytest.raises(InputError, match=r"none\.json: cannot be read"):
        read_cameras(tmp_path / "none.json", CAMERA)


def test_sway_moves_right_first_and_no_turn_exceeds_the_angle():
    sway, orbit = (path_cameras(path, [CAMERA] * 16, 60.0, 7.0) for path in ("sway", "orbit"))
    assert camera_centre(sway[4])[0] > 0 > camera_centre(sway[12])[0]
    turns = [degrees_between(CAMERA.rotation, camera.rotation) for camera in (*sway, *orbit)]
    assert max(turns) <= 60 + 1e-9 and degrees_between(CAMERA.rotation, orbit[0].rotation) == pytest.approx(60)


def test_cameras_between_two_are_on_the_way():
    end = turned(CAMERA, 0.6, 0.0, 7.0)
    five = along([CAMERA, end], 5)
    assert np.allclose(five[0].rotation, CAMERA.rotation) and np.allclose(five[4].translation, end.translation)
    assert np.allclose(five[2].rotation, turned(CAMERA, 0.3, 0.0, 7.0).rotation)
    assert np.allclose(camera_centre(five[2]), (camera_centre(CAMERA) + camera_centre(end)) / 2)
    assert along([CAMERA], 3) == [CAMERA] * 3 and along([CAMERA, end], 2) == [CAMERA, end]
    assert np.allclose(along([CAMERA, end], 1)[0].rotation, CAMERA.rotation)
