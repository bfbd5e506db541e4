"""Covariance (B2): rotation and semi-axes of any quaternion and log-scale; hard cases Q1, Q2, C6."""

import numpy as np
import pytest
from made_up_scenes import U32, U64, assert_close, assert_finite, plain_camera, random_scene
from scipy.spatial.transform import Rotation

from endotsr.definition import covariance as definition
from endotsr.method.splatting.covariance import (
    Shape,
    covariance_forward,
    covariance_matrix,
    covariance_reverse,
)
from endotsr.method.splatting.projection import projection_forward
from endotsr.method.splatting.settings import PAPER

CAMERA = plain_camera(33, 29, 25.0)


def test_rotation_and_covariance_equal_scipy_and_the_definition():
    rng = np.random.default_rng(0)
    q, s = rng.normal(0, 2, (4, 300)), rng.normal(0, 1, (3, 300))
    shape, _ = covariance_forward(q, s)
    wanted = Rotation.from_quat(q.T, scalar_first=True).as_matrix().transpose(1, 2, 0)
    assert np.abs(shape.rotation - wanted).max() <= 16 * U64
    np.testing.assert_allclose(shape.scale, np.exp(s), rtol=4 * U64)
    written, _ = definition.covariance_forward(q, s)
    assert np.abs(written.rotation - wanted).max() <= 16 * U64
    assert_close({"sigma": covariance_matrix(shape)}, {"sigma": definition.covariance_matrix(written)}, 1e-14)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("place", range(4))
def test_quaternions_of_one_number_are_half_turns(place, sign):
    q = np.zeros((4, 1))
    q[place] = sign * 3.0
    wanted = -np.eye(3) if place else np.eye(3)
    if place:
        wanted[place - 1, place - 1] = 1
    np.testing.assert_array_equal(covariance_forward(q, np.zeros((3, 1)))[0].rotation[:, :, 0], wanted)


@pytest.mark.parametrize("dtype, u, exponents", [(np.float64, U64, (-300, 300)), (np.float32, U32, (-37, 37))])
def test_hard_Q1_any_quaternion_length(dtype, u, exponents):
    rng = np.random.default_rng(1)
    q = rng.normal(0, 1, (4, 200)).astype(dtype)
    zero = np.zeros((3, 200), dtype)
    plain = covariance_forward(q, zero)[0].rotation
    for exponent in (*exponents, -23, -5, 7, 23):
        scaled = (q.astype(np.longdouble) * np.longdouble(10.0) ** exponent).astype(dtype)
        found = covariance_forward(scaled, zero)[0].rotation
        assert np.abs(found - plain).max() <= 32 * u
        product = np.einsum("ikn,jkn->ijn", found, found)
        assert np.abs(product - np.eye(3)[:, :, None]).max() <= 32 * u
    for power in (-90, -20, 1, 60, 90):
        np.testing.assert_array_equal(covariance_forward(np.ldexp(q, power), zero)[0].rotation, plain)


@pytest.mark.parametrize("quaternion", [(1, 0, 0, 0), (0, 1, 0, 0), (1, 2, 3, 4), (0, 0, 2, 1)])
def test_a_quaternion_and_its_negative_are_one_rotation_with_opposite_gradients(quaternion):
    rng = np.random.default_rng(4)
    q, s = np.array(quaternion, float)[:, None], np.zeros((3, 1))
    upstream = Shape(rng.normal(size=(3, 3, 1)), rng.normal(size=(3, 1)))
    shapes, saved = zip(*(covariance_forward(sign * q, s) for sign in (1, -1)), strict=True)
    np.testing.assert_array_equal(shapes[0].rotation, shapes[1].rotation)
    there, back = (covariance_reverse(upstream, one).d_quaternion for one in saved)
    assert np.abs(there).max() > 0.1
    np.testing.assert_array_equal(there, -back)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_Q1_zero_quaternion_is_the_identity_with_zero_gradient(dtype):
    q = np.array([[0.0, 0.0, 1.0], [0.0, -0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], dtype)
    s = np.zeros((3, 3), dtype)
    shape, saved = covariance_forward(q, s)
    np.testing.assert_array_equal(shape.rotation[:, :, 0], np.eye(3))
    np.testing.assert_array_equal(shape.rotation[:, :, 1], np.eye(3))
    rng = np.random.default_rng(2)
    d = Shape(rng.normal(0, 1, (3, 3, 3)).astype(dtype), rng.normal(0, 1, (3, 3)).astype(dtype))
    back = covariance_reverse(d, saved)
    assert (
        np.isfinite(back.d_quaternion).all() and (back.d_quaternion[:, :2] == 0).all() and back.d_quaternion[:, 2].any()
    )


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_hard_Q1_subnormal_quaternion_has_a_finite_gradient(dtype):
    """1 / |q| overflows there: the gradient is limited, never Inf or NaN."""
    tiny = np.nextafter(dtype(0), dtype(1))
    q = np.array([[tiny, tiny * 3, 0, 0], [0, tiny, tiny, 0], [0, 0, tiny, 0], [0, tiny, 0, tiny * 9]], dtype)
    shape, saved = covariance_forward(q, np.zeros((3, 4), dtype))
    rng = np.random.default_rng(3)
    d = Shape(rng.normal(0, 1, (3, 3, 4)).astype(dtype), rng.normal(0, 1, (3, 4)).astype(dtype))
    assert_finite(shape._asdict(), covariance_reverse(d, saved)._asdict())


@pytest.mark.parametrize(
    "dtype, bound, factors", [(np.float64, 1e-12, (1e-3, 7.0, 1e100)), (np.float32, 1e-5, (1e-3, 7, 1e15))]
)
def test_hard_Q2_gradient_is_orthogonal_and_scales_with_the_inverse_length(dtype, bound, factors):
    rng = np.random.default_rng(4)
    q, s = rng.normal(0, 1, (4, 200)).astype(dtype), rng.normal(0, 1, (3, 200)).astype(dtype)
    d = Shape(rng.normal(0, 1, (3, 3, 200)).astype(dtype), rng.normal(0, 1, (3, 200)).astype(dtype))
    g = covariance_reverse(d, covariance_forward(q, s)[1]).d_quaternion
    length = np.linalg.norm
    assert (np.abs((g * q).sum(axis=0)) <= bound * length(g, axis=0) * length(q, axis=0)).all()
    for factor in factors:
        other = covariance_reverse(d, covariance_forward(q * dtype(factor), s)[1]).d_quaternion
        np.testing.assert_allclose(other * dtype(factor), g, rtol=bound, atol=bound)


def test_hard_C6_log_scale_beyond_40_is_clipped_with_zero_gradient():
    s = np.array([[-800.0, -40.0, 40.0, 40.1], [-41.0, 0.0, 800.0, 39.9], [0.0, 1.0, 2.0, 3.0]])
    q = np.tile(np.array([[1.0], [0.5], [0], [0]]), (1, 4))
    shape, saved = covariance_forward(q, s)
    np.testing.assert_allclose(shape.scale, np.exp(np.clip(s, -40, 40)), rtol=4 * U64)
    back = covariance_reverse(Shape(np.zeros((3, 3, 4)), np.ones((3, 4))), saved)
    np.testing.assert_array_equal(back.d_log_scale != 0, np.abs(s) <= 40)


def test_hard_C6_log_scale_minus_800_leaves_the_low_pass_alone():
    scene = random_scene(5, 20, CAMERA)
    scene.log_scale[:] = -800.0
    shape, _ = covariance_forward(scene.quaternion, scene.log_scale)
    out, _ = projection_forward(scene.position, shape, CAMERA, PAPER)
    seen = out.visible
    np.testing.assert_array_equal(out.covariance2d[::2, seen], 0.3)
    assert np.abs(out.covariance2d[1]).max() <= 1e-30  # squares of exp(-40)
    np.testing.assert_array_equal(out.determinant[seen], 0.3 * 0.3)
