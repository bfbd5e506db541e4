"""Correction of a pose, equation (B16), against the matrix exponential and complex steps."""

import numpy as np
import pytest

from endotsr.method.equations.pose import pose_forward, pose_reverse
from oracle import pose_oracle

ANGLES = [0.0, 1e-12, 1e-5, 0.03, 0.4, 0.999, 1.001, 2.0, np.pi, 6.0]


def made_up(angle):
    """The given matrix is no rotation: its nine entries are independent."""
    rng = np.random.default_rng(16)
    axis = rng.normal(size=3)
    return rng.normal(size=(3, 3)), rng.normal(size=3), angle * axis / np.linalg.norm(axis), rng.normal(size=3)


@pytest.mark.parametrize("angle", ANGLES)
def test_values_and_gradients_equal_the_oracle(angle):
    given = made_up(angle)
    rng = np.random.default_rng(3)
    d_rotation, d_translation = rng.normal(size=(3, 3)), rng.normal(size=3)
    *found, saved = pose_forward(*given)
    grads = pose_reverse(d_rotation, d_translation, saved)
    expected = (*pose_oracle.corrected(*given), *pose_oracle.gradients(*given, d_rotation, d_translation))
    for one, right in zip((*found, *grads), expected, strict=True):
        assert one.dtype == np.float64
        np.testing.assert_allclose(one, right, rtol=1e-13, atol=2e-14)


def test_no_correction_changes_no_bit_and_nothing_is_written_into_the_inputs():
    rotation, translation, vector, offset = made_up(0.3)
    before = [a.copy() for a in (rotation, translation, vector, offset)]
    turned, moved, _ = pose_forward(rotation, translation, np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(turned, rotation)
    np.testing.assert_array_equal(moved, translation)
    pose_reverse(np.ones((3, 3)), np.ones(3), pose_forward(rotation, translation, vector, offset)[2])
    for now, then in zip((rotation, translation, vector, offset), before, strict=True):
        np.testing.assert_array_equal(now, then)
