"""The residual of two registered frames, equation (B19)."""

import numpy as np
import pytest

from endotsr.method.equations.pose import pose_forward, pose_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.registration import registration_forward, registration_reverse

CAMERA = Camera(np.eye(3), np.zeros(3), 30.0, 33.0, 10.3, 8.1, 20, 16)


def points_at(column, row, z):
    """Points that project to these positions, pixel centres at whole numbers."""
    x = (np.asarray(column) + 0.5 - CAMERA.cx) / CAMERA.fx * z
    y = (np.asarray(row) + 0.5 - CAMERA.cy) / CAMERA.fy * z
    return np.stack([x, y, np.broadcast_to(float(z), x.shape)])


def residual_of(points, picture, rotation=None, translation=None):
    reference = np.zeros(points.shape[1])
    turn, shift = np.eye(3) if rotation is None else rotation, np.zeros(3) if translation is None else translation
    return registration_forward(turn, shift, points, reference, picture, CAMERA)


def test_pixel_centres_give_the_pixels_and_parabolas_are_exact():
    picture = np.fromfunction(lambda j, i: 0.3 * i**2 - 0.2 * i * j + 0.1 * j**2 - j + 4, (16, 20))
    column, row = np.array([3.0, 7.25, 11.5, 2.9]), np.array([2.0, 5.5, 9.125, 12.7])
    found, saved = residual_of(points_at(column, row, 40.0), picture)
    expected = 0.3 * column**2 - 0.2 * column * row + 0.1 * row**2 - row + 4
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_allclose(saved.slope[0], (0.6 * column - 0.2 * row) * CAMERA.fx / 40, rtol=1e-11)


def test_points_that_are_not_seen_have_no_residual_and_no_gradient():
    picture = np.random.default_rng(0).normal(size=(16, 20))
    points = points_at([0.99, 1.0, 17.99, 18.01, 9, 9], [5, 5, 5, 5, 0.9, 13.99], 40.0)
    points = np.concatenate([points, -points[:, 1:2]], axis=1)
    found, saved = residual_of(points, picture)
    assert saved.seen.tolist() == [False, True, True, False, False, True, False]
    grads = registration_reverse(np.ones(7), saved)
    assert (found[~saved.seen] == 0).all() and (grads.d_points[:, ~saved.seen] == 0).all()
    assert (grads.d_reference == -saved.seen.astype(float)).all()


def test_a_row_of_the_jacobian_is_the_gradient_by_a_correction_of_the_pose():
    rng = np.random.default_rng(1)
    picture, points = rng.normal(size=(16, 20)), points_at(rng.uniform(3, 16, 5), rng.uniform(3, 12, 5), 40.0)
    turn, shift, _ = pose_forward(np.eye(3), np.zeros(3), np.array([0.01, -0.02, 0.03]), rng.normal(0, 0.3, 3))
    _, saved = residual_of(points, picture, turn, shift)
    placed = turn @ points + shift[:, None]
    rows = np.concatenate([np.cross(placed, saved.slope, axis=0), saved.slope])
    zero = pose_forward(turn, shift, np.zeros(3), np.zeros(3))[2]
    for k in range(5):
        grads = registration_reverse((np.arange(5) == k).astype(float), saved)
        found = pose_reverse(grads.d_rotation, grads.d_translation, zero)
        np.testing.assert_allclose(np.append(found.d_rotation_vector, found.d_offset), rows[:, k], rtol=1e-10)


@pytest.mark.parametrize("name", ["rotation", "translation", "points", "reference"])
def test_the_gradients_are_the_differences_of_the_residuals(name):
    rng = np.random.default_rng(2)
    picture = rng.normal(size=(16, 20))
    turn, shift, _ = pose_forward(np.eye(3), np.zeros(3), np.array([0.1, -0.05, 0.2]), np.array([0.4, -0.2, 0.7]))
    points = turn.T @ (points_at(rng.uniform(3, 16, 6), rng.uniform(3, 12, 6), 40.0) - shift[:, None])
    given = {"rotation": turn, "translation": shift, "points": points, "reference": rng.normal(size=6)}
    weight = rng.normal(size=6)
    grads = registration_reverse(weight, registration_forward(*given.values(), picture, CAMERA)[1])
    found = np.zeros_like(given[name])
    for at in np.ndindex(found.shape):
        ends = []
        for step in (1e-6, -1e-6):
            moved = given[name].copy()
            moved[at] += step
            ends.append(weight @ registration_forward(*(given | {name: moved}).values(), picture, CAMERA)[0])
        found[at] = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(getattr(grads, f"d_{name}"), found, rtol=1e-5, atol=1e-7)


def test_shapes_are_checked():
    with pytest.raises(ValueError, match=r"points \(3, 4\) and reference \(3,\)"):
        registration_forward(np.eye(3), np.zeros(3), np.ones((3, 4)), np.ones(3), np.ones((16, 20)), CAMERA)
