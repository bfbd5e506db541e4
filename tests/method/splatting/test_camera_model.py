"""The camera model is one pair of functions: with another pair in its place, the projection and its reverse follow."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from endotsr.method.splatting import projection_formulas as formulas


class Sheared(NamedTuple):
    """A pinhole whose image axes are not at a right angle: a model with a full Jacobian."""

    fx: float
    fy: float
    shear: float


def sheared(x, y, z, lens):
    j00, j01, j10, j11 = lens.fx / z, lens.shear / z, lens.shear / z, lens.fy / z
    u, v = j00 * x + j01 * y, j10 * x + j11 * y
    return u, v, (j00, j01, -u / z, j10, j11, -v / z)


def sheared_reverse(x, y, z, lens, d_u, d_v, d_z, d_jacobian):
    g00, g01, g02, g10, g11, g12 = d_jacobian
    _, _, (j00, j01, j02, j10, j11, j12) = sheared(x, y, z, lens)
    d_u, d_v = d_u - g02 / z, d_v - g12 / z
    d_z -= (g00 * j00 + g01 * j01 + g10 * j10 + g11 * j11 + g02 * j02 + g12 * j12) / z
    return d_u * j00 + d_v * j10, d_u * j01 + d_v * j11, d_z + d_u * j02 + d_v * j12


LENS, RULES = Sheared(300.0, 250.0, 40.0), formulas.Rules(0.3, 0.2, 1e60)
SIZES = (3, 3, 9, 9, 3)  # position, scale, rotation, and of the pose: rotation, translation


def plain(function):
    return getattr(function, "py_func", function)


def split(numbers):
    """Position, scale, rotation, pose."""
    position, scale, rotation, w, d = (tuple(p.tolist()) for p in np.split(numbers, np.cumsum(SIZES)[:-1]))
    return position, scale, rotation, formulas.WorldToCamera(w, d)


def projected(numbers):
    position, scale, rotation, pose = split(numbers)
    return plain(formulas.project_one)(position, rotation, scale, LENS, pose, RULES)


def outputs(numbers):
    """u, v, A, m, r, z."""
    _, (u, v, _, b, c, det, z) = projected(numbers)
    return np.array([u, v, c / det, b / c, 1 / c, z])


@pytest.fixture
def other_model(monkeypatch):
    monkeypatch.setattr(formulas, "pinhole", sheared)
    monkeypatch.setattr(formulas, "pinhole_reverse", sheared_reverse)


@pytest.fixture
def numbers():
    rng = np.random.default_rng(3)
    matrices = [m.as_matrix().ravel() for m in Rotation.random(2, rng=rng)]
    matrices[1] = Rotation.from_rotvec([0.2, -0.3, 0.1]).as_matrix().ravel()
    return np.concatenate([rng.normal(size=3) * 0.3, [0.05, 0.02, 0.08], *matrices, [0.1, -0.2, 3.0]])


def test_the_covariance_on_the_screen_is_that_of_the_other_model(other_model, numbers):
    drawn, found = projected(numbers)
    position, scale, rotation, (w, d) = split(numbers)
    w, r, m = (
        np.reshape(w, (3, 3)),
        np.reshape(rotation, (3, 3)),
        np.array([[LENS.fx, LENS.shear], [LENS.shear, LENS.fy]]),
    )
    x, y, z = w @ position + d
    u, v = m @ [x, y] / z
    t = np.column_stack([m, [-u, -v]]) / z @ w @ r @ np.diag(scale)
    (a, b), (_, c) = t @ t.T + RULES.low_pass * np.eye(2)
    assert drawn
    np.testing.assert_allclose(found, [u, v, a, b, c, a * c - b * b, z], rtol=1e-12)


def test_the_reverse_of_the_projection_is_that_of_the_other_model(other_model, numbers):
    d_out = np.random.default_rng(4).normal(size=6)
    position, scale, rotation, pose = split(numbers)
    _, (_, _, _, _, _, det, _) = projected(numbers)
    found = plain(formulas.project_one_reverse)(
        position, rotation, scale, LENS, pose, RULES, True, det, d_out[:2], d_out[2:5], d_out[5]
    )
    wanted = []
    for k in range(numbers.size):
        step = np.zeros(numbers.size)
        step[k] = 1e-5 * max(abs(numbers[k]), 0.1)
        wanted.append(d_out @ (outputs(numbers + step) - outputs(numbers - step)) / (2 * step[k]))
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())
