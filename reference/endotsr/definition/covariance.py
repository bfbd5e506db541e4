"""Equation (B2): quaternion and log-scale to rotation, semi-axes and covariance."""

from collections import namedtuple

import numpy as np

# CROSS[i, j, k] v_k = [v]_x: the matrix of the cross product with v
CROSS = np.cross(np.eye(3)[None], np.eye(3)[:, None]).transpose(2, 0, 1)


Shape = namedtuple("Shape", "rotation scale")  # Sigma = R diag(S)^2 R^T.
CovarianceSaved = namedtuple("CovarianceSaved", "quaternion log_scale")
CovarianceGrads = namedtuple("CovarianceGrads", "d_quaternion d_log_scale")


def unit(quaternion):
    """q / |q| (4, N) and 1 / |q| (N,), at most 1e20; (1, 0, 0, 0) and 0 for q = 0. The largest entry is divided out."""
    largest = np.abs(quaternion.real).max(axis=0, initial=0)
    zero = largest == 0
    q = np.where(zero, np.eye(4)[:, :1], quaternion / np.where(zero, 1, largest))
    norm = np.sqrt((q * q).sum(axis=0))
    return q / norm, np.where(zero, 0, 1 / norm / np.maximum(largest, 1e-20))


def rotation_of(q):
    """R (3, 3, N) of unit quaternions w + v: (w^2 - v.v) I + 2 v v^T + 2 w [v]_x; the kernel writes nine entries."""
    w, v = q[0], q[1:]
    outer = np.einsum("in,jn->ijn", v, v)
    cross = np.einsum("ijk,kn->ijn", CROSS, v)
    return (w * w - (v * v).sum(axis=0)) * np.eye(3)[:, :, None] + 2 * outer + 2 * w * cross  # (6.4)


def rotation_reverse(q, g):
    """From g = dL/dR (3, 3, N) to the unit quaternions (4, N).

    That of the printed nine entries is less by 2 trace(g) q, and (6.8) removes any multiple of q.
    """
    w, v = q[0], q[1:]
    trace = np.einsum("iin->n", g)
    spin = np.einsum("ijn,ijk->kn", g, CROSS)  # (6.5)
    along = np.einsum("ijn,jn->in", g + g.transpose(1, 0, 2), v)  # (6.6)
    g_w = 2 * w * trace + 2 * (spin * v).sum(axis=0)
    g_v = -2 * v * trace + 2 * along + 2 * w * spin
    return np.concatenate([[g_w], g_v])


def covariance_forward(quaternion, log_scale):
    """Equation (B2): Shape from raw quaternions (4, N) w, x, y, z and log-scales (3, N), clipped to +-40."""
    # In float32 the square of e^44.4 overflows, and that of e^-44 is not a normal number.
    scale = np.exp(np.where(np.abs(log_scale.real) > 40, np.copysign(40, log_scale.real), log_scale))
    return Shape(rotation_of(unit(quaternion)[0]), scale), CovarianceSaved(quaternion, log_scale)


def covariance_reverse(d_shape, saved):
    """Reverse of (B2): the component along q is removed; a clipped log-scale has gradient 0."""
    q, inverse_norm = unit(saved.quaternion)
    g = rotation_reverse(q, d_shape.rotation)
    d_quaternion = (g - (g * q).sum(axis=0) * q) * inverse_norm  # (6.8)
    free = np.abs(saved.log_scale) <= 40  # (6.3)
    scale = np.exp(np.clip(saved.log_scale, -40, 40))
    return CovarianceGrads(d_quaternion, np.where(free, d_shape.scale * scale, 0))


def covariance_matrix(shape):
    """Sigma (3, 3, N), scene units squared. The kernels never form it: Sigma of a needle loses digits."""
    return np.einsum("ikn,kn,jkn->ijn", shape.rotation, shape.scale**2, shape.rotation)
