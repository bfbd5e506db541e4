"""Calibrations of other programs: one camera, pairs, the half pixel, and what is refused."""

import cv2
import numpy as np
import pytest
from calibration_files import BENT, SHIFT, SIZE, TURN, kalibr, ros
from public_layouts import K, stereo_yaml

from endotsr.clips.formats.calibrations import calibrated
from endotsr.errors import InputError


def check_intrinsics(intrinsics, distortion):
    assert intrinsics[:6] == (100.0, 101.0, 64.0, 48.0, *SIZE)  # half a pixel more than the file
    np.testing.assert_allclose(intrinsics.distortion, distortion)


def test_one_camera_of_opencv(tmp_path):
    stereo_yaml(tmp_path / "a.yaml", image_width=128, image_height=96, camera_matrix=K,
                distortion_coefficients=np.array([BENT]))  # fmt: skip
    intrinsics, calibration = calibrated(tmp_path / "a.yaml", *SIZE)[:2]
    assert calibration is None
    check_intrinsics(intrinsics, BENT)


def test_pictures_of_half_the_size_scale_a_calibration_that_says_its_size(tmp_path):
    stereo_yaml(tmp_path / "a.yaml", image_width=128, image_height=96, camera_matrix=K)
    intrinsics = calibrated(tmp_path / "a.yaml", 64, 48).intrinsics
    assert intrinsics[:4] == (50.0, 50.5, 32.0, 24.0)
    with pytest.raises(InputError, match="the calibration is of 128x96"):
        calibrated(tmp_path / "a.yaml", 64, 64)


@pytest.mark.parametrize(
    ("of", "pictures"),
    [
        ((1920, 1080), (854, 480)),  # to even numbers
        ((1920, 1080), (853, 480)),
        ((1920, 1080), (640, 360)),  # exactly
        ((1280, 1024), (426, 341)),
        ((854, 480), (1920, 1080)),
    ],
)
def test_a_size_that_differs_by_rounding_scales_a_calibration_and_is_told(of, pictures, tmp_path):
    matrix = np.array([[1000.0, 0, of[0] / 2 - 0.5], [0, 1010.0, of[1] / 2 - 0.5], [0, 0, 1]])
    (tmp_path / "a.yaml").write_text(ros(matrix, image_width=of[0], image_height=of[1]))
    found = calibrated(tmp_path / "a.yaml", *pictures)
    across, down = pictures[0] / of[0], pictures[1] / of[1]
    expected = (1000 * across, 1010 * down, pictures[0] / 2, pictures[1] / 2, *pictures)
    np.testing.assert_allclose(found.intrinsics[:6], expected)
    sizes = "of {}x{} pixels, scaled to the {}x{} of the pictures".format(*of, *pictures)
    assert [sizes in note for note in found.notes] == [True], found.notes
    assert ("differ by rounding" in found.notes[0]) is (of[0] * pictures[1] != of[1] * pictures[0])


@pytest.mark.parametrize(
    ("of", "pictures"),
    [((1920, 1080), (848, 480)), ((1920, 1080), (720, 480)), ((1280, 1024), (1280, 1020)), ((854, 480), (1920, 1088))],
)
def test_a_size_that_differs_by_more_than_rounding_is_refused(of, pictures, tmp_path):
    (tmp_path / "a.yaml").write_text(ros(K, image_width=of[0], image_height=of[1]))
    with pytest.raises(InputError, match="the calibration is of {}x{} pixels".format(*of)):
        calibrated(tmp_path / "a.yaml", *pictures)


def test_the_scaling_of_a_pair_is_told_once_and_none_where_the_sizes_are_equal(tmp_path):
    (tmp_path / "a.yaml").write_text(kalibr(), encoding="utf-8")
    assert calibrated(tmp_path / "a.yaml", *SIZE).notes == ()
    assert len(calibrated(tmp_path / "a.yaml", 64, 48).notes) == 1


def test_a_pair_of_opencv(tmp_path):
    bent = np.array([BENT])
    stereo_yaml(tmp_path / "a.yaml", M1=K, D1=bent, M2=K, D2=bent, R=TURN, T=SHIFT.reshape(3, 1))
    intrinsics, calibration = calibrated(tmp_path / "a.yaml", *SIZE)[:2]
    assert intrinsics is None
    check_intrinsics(calibration.left, BENT)
    np.testing.assert_allclose(calibration.rotation, TURN)
    np.testing.assert_allclose(calibration.translation, SHIFT)


def test_one_camera_of_ros_and_of_kalibr(tmp_path):
    (tmp_path / "ros.yaml").write_text(ros(K))
    (tmp_path / "kalibr.yaml").write_text(kalibr(pair=False))
    check_intrinsics(calibrated(tmp_path / "ros.yaml", *SIZE).intrinsics, BENT)
    check_intrinsics(calibrated(tmp_path / "kalibr.yaml", *SIZE).intrinsics, BENT[:4])


def test_a_pair_of_kalibr_is_in_metres(tmp_path):
    (tmp_path / "a.yaml").write_text(kalibr())
    calibration = calibrated(tmp_path / "a.yaml", *SIZE).calibration
    np.testing.assert_allclose(calibration.translation, SHIFT)
    np.testing.assert_allclose(calibration.rotation, TURN)


def test_a_pair_of_ros_is_that_of_stereo_rectify(tmp_path):
    """OpenCV rectifies a known pair; its matrices, written as ROS does, give the pair back."""
    none = np.zeros(5)
    left, right, p_left, p_right, *_ = cv2.stereoRectify(K, none, K, none, SIZE, TURN, SHIFT.reshape(3, 1) / 1000)
    for name, turn, projection in (("left", left, p_left), ("right", right, p_right)):
        changes = {"rectification_matrix": {"data": turn.ravel().tolist()},
                   "projection_matrix": {"data": projection.ravel().tolist()}}  # fmt: skip
        (tmp_path / f"{name}.yaml").write_text(ros(K, none, **changes))
    calibration = calibrated(tmp_path, *SIZE).calibration
    np.testing.assert_allclose(calibration.rotation, TURN, atol=1e-9)
    np.testing.assert_allclose(calibration.translation, SHIFT, atol=1e-9)


@pytest.mark.parametrize("text", ["100 0 63.5\n0 101 47.5\n0 0 1\n", "[[100,0,63.5],[0,101,47.5],[0,0,1]]",
                                  "100 0 63.5 0\n0 101 47.5 0\n0 0 1 0\n"])  # fmt: skip
def test_a_matrix_as_text(text, tmp_path):
    (tmp_path / "K.txt").write_text(text)
    check_intrinsics(calibrated(tmp_path / "K.txt", *SIZE).intrinsics, ())


FISH = {"distortion_model": "equidistant"}
REFUSED = {
    "a.yaml: not YAML": ("a.yaml", "a: [1"),
    "no calibration that is known": ("a.yaml", "hello: 1"),
    "holds no keys": ("b.yaml", "- 1"),
    "distortion_model 'equidistant'": ("a.yaml", ros(K, **FISH)),
    "distortion_model 'equidistant' is": ("a.yaml", kalibr(**FISH)),
    "camera_model 'omni'": ("a.yaml", kalibr(camera_model="omni")),
    "6 distortion coefficients": ("a.yaml", ros(K, [0.1] * 6)),
    "resolution": ("a.yaml", kalibr(resolution=[128.5, 96])),
    "use 3x3 finite numbers": ("a.yaml", "camera_matrix: [1, 2]"),
    "D: use n finite numbers": ("a.yaml", "K: [1,0,0,0,1,0,0,0,1]\nD: [[1, 2], [3]]"),
    "dist: use n finite numbers": ("a.yaml", "mtx: [1,0,0,0,1,0,0,0,1]\ndist: {rows: 1}"),
    "R is missing": ("a.yaml", "M1: [1,0,0,0,1,0,0,0,1]\nM2: [1,0,0,0,1,0,0,0,1]"),
    "could not determine a constructor": ("a.yaml", "camera_matrix: !!python/object/apply:os.getcwd []"),
    "4 words": ("a.txt", "1 2 3 4"),
    "use rows": ("a.txt", "100 0 63 0 100 47 0 1 1"),
    "use FILE.ini": ("a.dat", "<x/>"),
}  # fmt: skip


@pytest.mark.parametrize("said", REFUSED)
def test_what_is_no_calibration_is_refused(said, tmp_path):
    name, text = REFUSED[said]
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=name) as caught:
        calibrated(tmp_path / name, *SIZE)
    assert said in str(caught.value)


def test_a_pair_of_matlab_has_transposed_matrices_and_counts_pixels_from_one(tmp_path):
    from scipy.io import savemat

    one = {"IntrinsicMatrix": np.array([[100.0, 0, 0], [0, 101, 0], [33, 25, 1]]), "ImageSize": [[48, 64]],
           "RadialDistortion": [[0.1, 0.2, 0.3]], "TangentialDistortion": [[0.01, 0.02]]}  # fmt: skip
    pair = {"CameraParameters1": one, "CameraParameters2": one, "RotationOfCamera2": np.array(TURN).T,
            "TranslationOfCamera2": [[-4.0, 0.1, 0.2]]}  # fmt: skip
    savemat(tmp_path / "a.mat", pair)
    found = calibrated(tmp_path / "a.mat", 64, 48).calibration
    np.testing.assert_allclose(found.rotation, TURN)
    np.testing.assert_allclose(found.translation, [-4.0, 0.1, 0.2])
    assert found.left[:4] == (100.0, 101.0, 32.5, 24.5)  # the first pixel has its centre at 0.5 here
    assert found.left.distortion == (0.1, 0.2, 0.01, 0.02, 0.3)
