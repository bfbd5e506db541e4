"""Two focal lengths, for which the projection is exact, and the angle between two poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from endotsr.method.splatting.camera import Camera, degrees_between
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.projection import projection_forward
from endotsr.method.splatting.settings import EXACT


def test_focal_lengths_that_differ_stretch_the_picture_exactly():
    """fy = 2 fx is the square camera with one axis stretched: v doubles, u stays, and so do the covariances."""
    square = Camera(np.eye(3), np.zeros(3), 20.0, 20.0, 16.0, 16.0, 32, 32)
    tall = square._replace(fy=40.0, cy=32.0, height=64)
    rng = np.random.default_rng(0)
    position = rng.uniform([[-2.0], [-2.0], [4.0]], [[2.0], [2.0], [9.0]], (3, 50))
    shape, _ = covariance_forward(rng.standard_normal((4, 50)), rng.uniform(-2.0, 0.0, (3, 50)))
    rules = EXACT._replace(low_pass=0.0)
    a, b = (projection_forward(position, shape, camera, rules)[0] for camera in (square, tall))
    np.testing.assert_allclose(b.mean2d, a.mean2d * [[1.0], [2.0]], rtol=1e-13)
    np.testing.assert_allclose(b.covariance2d, a.covariance2d * [[1.0], [2.0], [4.0]], rtol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 0.5, 90.0, 179.5, 180.0])
def test_the_angle_between_two_rotations_is_the_one_they_were_made_with(degrees):
    one = Rotation.random(rng=3)
    other = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])) * one
    found = degrees_between(one.as_matrix(), other.as_matrix())
    np.testing.assert_allclose(found, degrees, rtol=1e-9, atol=3e-6)  # an arc cosine has half the digits at its ends


def test_a_cosine_outside_its_range_by_rounding_gives_the_end_of_the_range():
    one = Rotation.random(rng=0)
    rotation, turned = one.as_matrix(), (Rotation.from_rotvec(np.pi * np.array([0.6, 0.0, 0.8])) * one).as_matrix()
    assert (np.trace(rotation @ rotation.T) - 1) / 2 > 1 and (np.trace(rotation @ turned.T) - 1) / 2 < -1
    assert degrees_between(rotation, rotation) == 0.0 and degrees_between(rotation, turned) == 180.0
