"""Two focal lengths and a principal point anywhere: the projection is exact and not clamped in view."""

import numpy as np
import pytest

from endotsr.splatting.camera import Camera, backproject
from endotsr.splatting.covariance import covariance_forward
from endotsr.splatting.projection import projection_forward
from endotsr.splatting.settings import EXACT, PAPER


@pytest.mark.parametrize("centre", [(4.0, 14.5), (30.0, 27.0), (16.5, 2.0)])
def test_a_principal_point_far_off_the_centre_is_exact_inside_the_picture(centre):
    """`paper` clamps the Jacobian far off axis, `exact` never; inside the picture they agree wherever the axis is."""
    camera = Camera(np.eye(3), np.zeros(3), 20.0, 31.0, *centre, 33, 29)
    column, row = np.meshgrid(np.arange(33.0), np.arange(29.0))
    position = backproject(camera, column.ravel(), row.ravel(), np.full(33 * 29, 7.0))
    shape, _ = covariance_forward(np.tile([[1.0], [0.0], [0.0], [0.0]], 957), np.full((3, 957), -2.0))
    paper, exact = (projection_forward(position, shape, camera, rules)[0] for rules in (PAPER, EXACT))
    for ours, whole in zip(paper, exact, strict=True):
        np.testing.assert_array_equal(ours, whole)


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
