"""The angle between two poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from endotsr.method.splatting.camera import degrees_between


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
