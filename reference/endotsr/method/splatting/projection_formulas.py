"""The projection of one Gaussian: the formulas of specification B3, each above its reverse.

Scalars and tuples of scalars in, tuples out; a matrix is the tuple of its rows. `projection_kernels` applies them to
all Gaussians. Selects replace branches, so the loop over a group vectorises.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from endotsr.method.kernels.jit import jit_formula
from endotsr.method.splatting.camera_model import pinhole, pinhole_reverse


class WorldToCamera(NamedTuple):
    """World to camera axes, in the dtype of the Gaussians."""

    rotation: tuple[Any, ...]  # W, 9 numbers
    translation: tuple[Any, ...]  # d, 3 numbers


class Rules(NamedTuple):
    """Constants of the projection, in the dtype of the Gaussians."""

    low_pass: np.floating  # epsilon, px^2
    near: np.floating  # scene units
    axis_limit: np.floating  # px: of |du| + |dv| of a projected semi-axis, which is clipped, and of |u| and |v|


@jit_formula
def to_view(position, pose):
    """(x, y, z) = W mu + d: the centre in camera axes."""
    p0, p1, p2 = position
    w00, w01, w02, w10, w11, w12, w20, w21, w22 = pose.rotation
    d0, d1, d2 = pose.translation
    return (
        w00 * p0 + w01 * p1 + w02 * p2 + d0,
        w10 * p0 + w11 * p1 + w12 * p2 + d1,
        w20 * p0 + w21 * p1 + w22 * p2 + d2,
    )


@jit_formula
def to_view_reverse(pose, d_x, d_y, d_z):
    """Gradient of the centre: W^T (g_x, g_y, g_z)."""
    w00, w01, w02, w10, w11, w12, w20, w21, w22 = pose.rotation
    return (
        w00 * d_x + w10 * d_y + w20 * d_z,
        w01 * d_x + w11 * d_y + w21 * d_z,
        w02 * d_x + w12 * d_y + w22 * d_z,
    )


@jit_formula
def pose_reverse(position, d_w, d_x, d_y, d_z):
    """Gradients of W and d: `d_w` comes through J W, the other terms through the centre in camera axes."""
    p0, p1, p2 = position
    return (
        d_w[0] + d_x * p0, d_w[1] + d_x * p1, d_w[2] + d_x * p2,
        d_w[3] + d_y * p0, d_w[4] + d_y * p1, d_w[5] + d_y * p2,
        d_w[6] + d_z * p0, d_w[7] + d_z * p1, d_w[8] + d_z * p2,
        d_x, d_y, d_z,
    )  # fmt: skip


@jit_formula
def product(a, b):
    """A 2x3 matrix times a 3x3 matrix: J W, and T = (J W) R."""
    a00, a01, a02, a10, a11, a12 = a
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = b
    return (
        a00 * b00 + a01 * b10 + a02 * b20, a00 * b01 + a01 * b11 + a02 * b21, a00 * b02 + a01 * b12 + a02 * b22,
        a10 * b00 + a11 * b10 + a12 * b20, a10 * b01 + a11 * b11 + a12 * b21, a10 * b02 + a11 * b12 + a12 * b22,
    )  # fmt: skip


@jit_formula
def product_reverse(a, b, d_product):
    """Gradients of the left factor, G b^T, and of the right one, a^T G."""
    a00, a01, a02, a10, a11, a12 = a
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = b
    g00, g01, g02, g10, g11, g12 = d_product
    d_a = (
        g00 * b00 + g01 * b01 + g02 * b02, g00 * b10 + g01 * b11 + g02 * b12, g00 * b20 + g01 * b21 + g02 * b22,
        g10 * b00 + g11 * b01 + g12 * b02, g10 * b10 + g11 * b11 + g12 * b12, g10 * b20 + g11 * b21 + g12 * b22,
    )  # fmt: skip
    d_b = (
        a00 * g00 + a10 * g10, a00 * g01 + a10 * g11, a00 * g02 + a10 * g12,
        a01 * g00 + a11 * g10, a01 * g01 + a11 * g11, a01 * g02 + a11 * g12,
        a02 * g00 + a12 * g10, a02 * g01 + a12 * g11, a02 * g02 + a12 * g12,
    )  # fmt: skip
    return d_a, d_b


@jit_formula
def clipped_axis(t0, t1, scale, limit):
    """S_k clipped to S_k (|t0| + |t1|) <= `limit` px, and whether it is unclipped; (t0, t1) is column k of T."""
    length = abs(t0) + abs(t1)
    free = not scale * length > limit  # written so that a NaN scale stays NaN
    return scale if free else limit / length, free


@jit_formula
def clipped_axes(t, scale, limit):
    """The three semi-axes, and which of them are unclipped."""
    s0, free0 = clipped_axis(t[0], t[3], scale[0], limit)
    s1, free1 = clipped_axis(t[1], t[4], scale[1], limit)
    s2, free2 = clipped_axis(t[2], t[5], scale[2], limit)
    return (s0, s1, s2), (free0, free1, free2)


@jit_formula
def screen_covariance(t, s, low_pass):
    """a, b, c = T diag(S)^2 T^T + epsilon I in px^2; the determinant in px^4, a sum of non-negative terms."""
    t00, t01, t02, t10, t11, t12 = t
    s0, s1, s2 = s
    u0, u1, u2, v0, v1, v2 = t00 * s0, t01 * s1, t02 * s2, t10 * s0, t11 * s1, t12 * s2
    a = low_pass + u0 * u0 + u1 * u1 + u2 * u2
    b = u0 * v0 + u1 * v1 + u2 * v2
    c = low_pass + v0 * v0 + v1 * v1 + v2 * v2
    spread = (u0 * u0 + v0 * v0) + (u1 * u1 + v1 * v1) + (u2 * u2 + v2 * v2)
    area01 = s0 * s1 * (t00 * t11 - t01 * t10)
    area12 = s1 * s2 * (t01 * t12 - t02 * t11)
    area20 = s2 * s0 * (t02 * t10 - t00 * t12)
    areas = area01 * area01 + area12 * area12 + area20 * area20
    return a, b, c, low_pass * low_pass + low_pass * spread + areas


@jit_formula
def axis_reverse(t0, t1, s, e, m, g_a, g_m, g_r, free):
    """Gradients of column k of T and of S_k; `free`: a clipped axis is constant.

    g_a = 2 A^2 g_A, g_m = r g_m, g_r = 2 r^2 g_r of the specification.
    """
    two, zero = type(s)(2), type(s)(0)
    d_t0 = s * s * (g_m * t1 - g_a * e)
    d_t1 = s * s * (g_a * m * e + g_m * (e - m * t1) - g_r * t1)
    d_s = s * (two * g_m * t1 * e - g_a * e * e - g_r * t1 * t1)
    return (d_t0 if free else zero), (d_t1 if free else zero), (d_s if free else zero)


@jit_formula
def screen_covariance_reverse(t, s, free, low_pass, determinant, d_footprint):
    """Gradients of T and S, from the gradients of A, m, r of the footprint."""
    t00, t01, t02, t10, t11, t12 = t
    s0, s1, s2 = s
    free0, free1, free2 = free
    d_precision, d_slope, d_inverse_c = d_footprint
    one, two = type(s0)(1), type(s0)(2)
    _, b, c, _ = screen_covariance(t, s, low_pass)
    m, r, precision = b / c, one / c, c / determinant
    g_a = two * precision * precision * d_precision
    g_m, g_r = r * d_slope, two * r * r * d_inverse_c
    # e = t0 - m t1 without cancellation: along a needle it is small, and the gradient of the length depends on it alone
    x01, x12, x20 = t00 * t11 - t01 * t10, t01 * t12 - t02 * t11, t02 * t10 - t00 * t12
    w0, w1, w2 = (t10 * s0) * s0, (t11 * s1) * s1, (t12 * s2) * s2
    e0 = r * (low_pass * t00 + w1 * x01 - w2 * x20)
    e1 = r * (low_pass * t01 + w2 * x12 - w0 * x01)
    e2 = r * (low_pass * t02 + w0 * x20 - w1 * x12)
    d_t00, d_t10, d_s0 = axis_reverse(t00, t10, s0, e0, m, g_a, g_m, g_r, free0)
    d_t01, d_t11, d_s1 = axis_reverse(t01, t11, s1, e1, m, g_a, g_m, g_r, free1)
    d_t02, d_t12, d_s2 = axis_reverse(t02, t12, s2, e2, m, g_a, g_m, g_r, free2)
    return (d_t00, d_t01, d_t02, d_t10, d_t11, d_t12), (d_s0, d_s1, d_s2)


@jit_formula
def project_one(position, rotation, scale, lens, pose, rules):
    """Whether the Gaussian is drawn, and (u, v, a, b, c, det, z), meaningless if it is not drawn."""
    x, y, z = to_view(position, pose)
    in_front = z > rules.near
    u, v, jacobian = pinhole(x, y, z if in_front else type(z)(1), lens)
    t = product(product(jacobian, pose.rotation), rotation)
    s, _ = clipped_axes(t, scale, rules.axis_limit)
    a, b, c, det = screen_covariance(t, s, rules.low_pass)
    # a centre out of range, or any NaN or infinity: not drawn, because such numbers must not become indices
    in_range = (abs(u) <= rules.axis_limit) & (abs(v) <= rules.axis_limit)
    return in_front & in_range & math.isfinite(det + z), (u, v, a, b, c, det, z)


@jit_formula
def project_one_reverse(
    position, rotation, scale, lens, pose, rules, drawn, determinant, d_mean, d_footprint, d_depth
):  # fmt: skip
    """Gradients of position (3), scale (3), rotation (9) and pose (9 + 3); meaningless if the Gaussian is not drawn."""
    one = type(determinant)(1)
    x, y, z = to_view(position, pose)
    z, determinant = (z if drawn else one), (determinant if drawn else one)
    _, _, jacobian = pinhole(x, y, z, lens)
    jw = product(jacobian, pose.rotation)
    t = product(jw, rotation)
    s, free = clipped_axes(t, scale, rules.axis_limit)
    d_t, d_scale = screen_covariance_reverse(t, s, free, rules.low_pass, determinant, d_footprint)
    d_jw, d_rotation = product_reverse(jw, rotation, d_t)
    d_jacobian, d_w = product_reverse(jacobian, pose.rotation, d_jw)
    d_x, d_y, d_z = pinhole_reverse(x, y, z, lens, d_mean[0], d_mean[1], d_depth, d_jacobian)
    d_position = to_view_reverse(pose, d_x, d_y, d_z)
    return d_position + d_scale + d_rotation + pose_reverse(position, d_w, d_x, d_y, d_z)
