"""Quaternion and log-scale to a covariance in factored form (specification B2).

Sigma = (R S)(R S)^T with R the rotation of the normalised quaternion and S = diag(exp(log_scale)). The projection
uses R and S directly: forming Sigma would lose the determinant of a needle seen at an angle.
"""

import math
from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.elementary import exponential
from endotsr.method.kernels.groups import GROUP, column, keep, write_group
from endotsr.method.kernels.jit import jit, jit_formula
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.kernels.vectors import local_array

LOG_SCALE_LIMIT = 40.0  # exp(+-40) spans 34 decades: beyond it the scale is clipped and its gradient is zero
ROTATION, GRADIENTS = 9 * GROUP, 7 * GROUP  # sizes of the results of a group
SHORTEST_QUATERNION = 1e-20  # bounds 1/|q| in the gradient, which would overflow in float32

_U64 = np.uint64  # unsigned: no index wraps around


class Shape(NamedTuple):
    """Factored covariance: Sigma = (rotation * scale) (rotation * scale)^T."""

    rotation: FloatArray  # (3, 3, N)
    scale: FloatArray  # (3, N) semi-axes, scene units, > 0


class CovarianceSaved(NamedTuple):
    """The inputs, and the semi-axes, which the reverse pass need not recompute."""

    quaternion: FloatArray
    log_scale: FloatArray
    scale: FloatArray


class CovarianceGrads(NamedTuple):
    """Gradients with respect to the raw parameters."""

    d_quaternion: FloatArray  # (4, N)
    d_log_scale: FloatArray  # (3, N)


# One Gaussian: the formulas of the specification, each above its reverse.


@jit_formula
def unit_quaternion(w, x, y, z):
    """The normalised quaternion and 1/norm, at most 1e20; (1, 0, 0, 0) and 0 for the zero quaternion.

    The largest entry is divided out first, so the squares do not overflow or underflow for norms of 1e-300 to 1e300.
    """
    real = type(w)
    zero, one = real(0), real(1)
    largest = max(max(abs(w), abs(x)), max(abs(y), abs(z)))
    if largest == zero:
        return one, zero, zero, zero, zero
    w, x, y, z = w / largest, x / largest, y / largest, z / largest
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    inverse_norm = (one / norm) / max(largest, real(SHORTEST_QUATERNION))
    return w / norm, x / norm, y / norm, z / norm, inverse_norm


@jit_formula
def unit_quaternion_reverse(w, x, y, z, inverse_norm, d_unit):
    """Gradient of the raw quaternion: the component along it is removed, the rest divided by the norm."""
    d_w, d_x, d_y, d_z = d_unit
    along = d_w * w + d_x * x + d_y * y + d_z * z
    return (
        (d_w - along * w) * inverse_norm,
        (d_x - along * x) * inverse_norm,
        (d_y - along * y) * inverse_norm,
        (d_z - along * z) * inverse_norm,
    )


@jit_formula
def rotation_of(w, x, y, z):
    """R(q) of a unit quaternion, row by row."""
    one, two = type(w)(1), type(w)(2)
    return (
        one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y),
        two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x),
        two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y),
    )  # fmt: skip


@jit_formula
def rotation_reverse(w, x, y, z, d_rotation):
    """Gradient of the unit quaternion, from G = dL/dR, all nine entries independent, row by row."""
    two = type(w)(2)
    g00, g01, g02, g10, g11, g12, g20, g21, g22 = d_rotation
    return (
        two * (x * (g21 - g12) + y * (g02 - g20) + z * (g10 - g01)),
        two * (-two * x * (g11 + g22) + y * (g01 + g10) + z * (g02 + g20) + w * (g21 - g12)),
        two * (x * (g01 + g10) - two * y * (g00 + g22) + z * (g12 + g21) + w * (g02 - g20)),
        two * (x * (g02 + g20) + y * (g12 + g21) - two * z * (g00 + g11) + w * (g10 - g01)),
    )


@jit_formula
def semi_axis(log_scale):
    """S = exp(s), s clipped."""
    limit = type(log_scale)(LOG_SCALE_LIMIT)
    return exponential(min(max(log_scale, -limit), limit))


@jit_formula
def semi_axis_reverse(log_scale, scale, d_scale):
    """Gradient of the log-scale; zero where it was clipped."""
    inside = abs(log_scale) <= type(log_scale)(LOG_SCALE_LIMIT)
    return d_scale * scale if inside else type(log_scale)(0)


# All Gaussians: a group at a time, as vector code (`groups`).


def _covariance_forward(first, stop, quaternion, log_scale, rotation, scale):
    """`rotation` (9, N)."""
    results = local_array(ROTATION, quaternion)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            w, x, y, z, _ = unit_quaternion(*column(quaternion, 4, start + item))
            keep(results, item, rotation_of(w, x, y, z))
        write_group(results, start, count, rotation)
        for k in range(3):  # a separate loop: the exponential does not vectorise
            for item in range(count):
                i = _U64(start + item)
                scale[k, i] = semi_axis(log_scale[k, i])


def _covariance_reverse(first, stop, quaternion, log_scale, scale, d_rotation, d_scale, d_out):
    """`d_rotation` (9, N); `d_out` (7, N): gradients with respect to quaternion and log-scale."""
    results = local_array(GRADIENTS, quaternion)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count):
            i = start + item
            w, x, y, z, inverse_norm = unit_quaternion(*column(quaternion, 4, i))
            d_unit = rotation_reverse(w, x, y, z, column(d_rotation, 9, i))
            d_q = unit_quaternion_reverse(w, x, y, z, inverse_norm, d_unit)
            s, axes, d_axes = column(log_scale, 3, i), column(scale, 3, i), column(d_scale, 3, i)
            d_s = (
                semi_axis_reverse(s[0], axes[0], d_axes[0]),
                semi_axis_reverse(s[1], axes[1], d_axes[1]),
                semi_axis_reverse(s[2], axes[2], d_axes[2]),
            )
            keep(results, item, d_q + d_s)
        write_group(results, start, count, d_out)


_forward_kernel = jit(_covariance_forward)
_reverse_kernel = jit(_covariance_reverse)


def covariance_forward(quaternion: FloatArray, log_scale: FloatArray) -> tuple[Shape, CovarianceSaved]:
    """Factored covariance of N Gaussians (specification B2).

    quaternion  (4, N) raw w, x, y, z of any nonzero length; normalised here
    log_scale   (3, N) natural log of the semi-axes; clipped to +-40
    returns     Shape(rotation (3, 3, N), scale (3, N) scene units)

    Reverse: `covariance_reverse`; the gradient is orthogonal to the quaternion and scales with 1/|q|.
    Edges:   the zero quaternion is the identity with zero gradient; with a largest entry below 1e-20, the gradient
             is that of q lengthened until it is 1e-20; a clipped log-scale has zero gradient.
    Oracle:  scipy.spatial.transform.Rotation; `endotsr.definition.covariance`.
    """
    n = quaternion.shape[1]
    rotation = np.empty((9, n), quaternion.dtype)
    scale = np.empty((3, n), quaternion.dtype)
    parallel_for(_forward_kernel, n, quaternion, log_scale, rotation, scale)
    return Shape(rotation.reshape(3, 3, n), scale), CovarianceSaved(quaternion, log_scale, scale)


def covariance_reverse(d_shape: Shape, saved: CovarianceSaved) -> CovarianceGrads:
    """Gradients of quaternion and log-scale, from dL/drotation (all nine entries independent) and dL/dscale."""
    n = saved.quaternion.shape[1]
    d_out = np.empty((7, n), saved.quaternion.dtype)
    parallel_for(_reverse_kernel, n, *saved, d_shape.rotation.reshape(9, n), d_shape.scale, d_out)
    return CovarianceGrads(d_out[:4], d_out[4:])


def covariance_matrix(shape: Shape) -> FloatArray:
    """Sigma (3, 3, N), scene units squared; for oracles and exports, not used by the rasteriser."""
    factor = shape.rotation * shape.scale
    return np.einsum("ikn,jkn->ijn", factor, factor)
