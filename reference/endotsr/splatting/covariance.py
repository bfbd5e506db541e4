"""Quaternion and log-scale to a covariance in factored form (specification B2).

Sigma = (R S)(R S)^T with R the rotation of the normalised quaternion and S = diag(exp(log_scale)). The
projection works on R and S themselves: the determinant of a needle seen at an angle is lost once Sigma is formed.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.jit import jit
from endotsr.kernels.threads import parallel_for
from endotsr.kernels.vectors import GROUP, local_array, write_group

FloatArray = NDArray[np.floating]

LOG_SCALE_LIMIT = 40.0  # exp(+-40) spans 34 decades: beyond it the scale is clipped and its gradient is zero
ROTATION = 9 * GROUP  # numbers that the results of a group take: the matrix
GRADIENTS = 7 * GROUP  # and by quaternion and log-scale
SHORTEST_QUATERNION = 1e-20  # a shorter quaternion gets the gradient of this length: 1/|q| would overflow in float32


_U64 = np.uint64  # no index may count from the end


class Shape(NamedTuple):
    """Factored covariance: Sigma = (rotation * scale) (rotation * scale)^T."""

    rotation: FloatArray  # (3, 3, N)
    scale: FloatArray  # (3, N) semi-axes, scene units, > 0


class CovarianceSaved(NamedTuple):
    """What the reverse pass needs: the inputs, and the semi-axes, so that no exponential is taken twice."""

    quaternion: FloatArray
    log_scale: FloatArray
    scale: FloatArray


class CovarianceGrads(NamedTuple):
    """Gradients by the raw parameters."""

    quaternion: FloatArray  # (4, N)
    log_scale: FloatArray  # (3, N)


def _unit_quaternion(w, x, y, z):
    """The normalised quaternion and 1/norm; (1, 0, 0, 0) and 0 for the zero quaternion.

    Dividing by the largest entry first keeps the squares inside the exponent range for norms of 1e-300 to 1e300.
    """
    zero = w - w
    one = zero + type(zero)(1)
    largest = max(max(abs(w), abs(x)), max(abs(y), abs(z)))
    if largest == zero:
        return one, zero, zero, zero, zero
    w /= largest
    x /= largest
    y /= largest
    z /= largest
    n = math.sqrt(w * w + x * x + y * y + z * z)
    return w / n, x / n, y / n, z / n, (one / n) / max(largest, type(zero)(SHORTEST_QUATERNION))


unit_quaternion = jit(_unit_quaternion)


def _covariance_forward(first, stop, quaternion, log_scale, rotation, scale):
    """`rotation` (9, N). Results of a group wait in a local array, so that its loop is vector code (`vectors`)."""
    real = quaternion.dtype.type
    one, two, limit = real(1), real(2), real(LOG_SCALE_LIMIT)
    results = local_array(ROTATION, quaternion)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for lane in range(count):
            i = _U64(start + lane)
            w, x, y, z, _ = unit_quaternion(quaternion[0, i], quaternion[1, i], quaternion[2, i], quaternion[3, i])
            results[_U64(lane)] = one - two * (y * y + z * z)
            results[_U64(GROUP + lane)] = two * (x * y - w * z)
            results[_U64(2 * GROUP + lane)] = two * (x * z + w * y)
            results[_U64(3 * GROUP + lane)] = two * (x * y + w * z)
            results[_U64(4 * GROUP + lane)] = one - two * (x * x + z * z)
            results[_U64(5 * GROUP + lane)] = two * (y * z - w * x)
            results[_U64(6 * GROUP + lane)] = two * (x * z - w * y)
            results[_U64(7 * GROUP + lane)] = two * (y * z + w * x)
            results[_U64(8 * GROUP + lane)] = one - two * (x * x + y * y)
        write_group(results, start, count, rotation)
        for k in range(3):
            for lane in range(count):
                i = _U64(start + lane)
                scale[k, i] = math.exp(min(max(log_scale[k, i], -limit), limit))


def _covariance_reverse(first, stop, quaternion, log_scale, scale, d_rotation, d_scale, d_out):
    """`d_out` (7, N): gradients by quaternion and log-scale."""
    real = quaternion.dtype.type
    two, limit, zero = real(2), real(LOG_SCALE_LIMIT), real(0)
    results = local_array(GRADIENTS, quaternion)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for lane in range(count):
            i = _U64(start + lane)
            w, x, y, z, inverse_norm = unit_quaternion(
                quaternion[0, i], quaternion[1, i], quaternion[2, i], quaternion[3, i]
            )
            g00, g01, g02 = d_rotation[0, 0, i], d_rotation[0, 1, i], d_rotation[0, 2, i]
            g10, g11, g12 = d_rotation[1, 0, i], d_rotation[1, 1, i], d_rotation[1, 2, i]
            g20, g21, g22 = d_rotation[2, 0, i], d_rotation[2, 1, i], d_rotation[2, 2, i]
            gw = two * (x * (g21 - g12) + y * (g02 - g20) + z * (g10 - g01))
            gx = two * (-two * x * (g11 + g22) + y * (g01 + g10) + z * (g02 + g20) + w * (g21 - g12))
            gy = two * (x * (g01 + g10) - two * y * (g00 + g22) + z * (g12 + g21) + w * (g02 - g20))
            gz = two * (x * (g02 + g20) + y * (g12 + g21) - two * z * (g00 + g11) + w * (g10 - g01))
            # normalisation: remove the part along q, divide by the norm (inverse_norm is 0 for the zero quaternion)
            along = gw * w + gx * x + gy * y + gz * z
            results[_U64(lane)] = (gw - along * w) * inverse_norm
            results[_U64(GROUP + lane)] = (gx - along * x) * inverse_norm
            results[_U64(2 * GROUP + lane)] = (gy - along * y) * inverse_norm
            results[_U64(3 * GROUP + lane)] = (gz - along * z) * inverse_norm
            for k in range(3):
                inside = abs(log_scale[k, i]) <= limit
                results[_U64((4 + k) * GROUP + lane)] = d_scale[k, i] * scale[k, i] if inside else zero
        write_group(results, start, count, d_out)


_forward_kernel = jit(_covariance_forward)
_reverse_kernel = jit(_covariance_reverse)


def covariance_forward(quaternion: FloatArray, log_scale: FloatArray) -> tuple[Shape, CovarianceSaved]:
    """Factored covariance of N Gaussians (specification B2).

    quaternion  (4, N) raw w, x, y, z of any nonzero length; normalised here
    log_scale   (3, N) natural log of the semi-axes; clipped to +-40
    returns     Shape(rotation (3, 3, N), scale (3, N) scene units)

    Reverse: `covariance_reverse`; the gradient is orthogonal to the quaternion and scales with 1/|q|.
    Edges:   the zero quaternion is the identity with zero gradient, below |q| = 1e-20 the gradient is that of 1e-20;
             a clipped log-scale has zero gradient (`covariance_degenerate` counts zeros and clipped).
    Oracle:  scipy.spatial.transform.Rotation; tests/oracle/splatting_oracle.py.
    """
    n = quaternion.shape[1]
    rotation = np.empty((9, n), quaternion.dtype)
    scale = np.empty((3, n), quaternion.dtype)
    parallel_for(_forward_kernel, n, quaternion, log_scale, rotation, scale)
    return Shape(rotation.reshape(3, 3, n), scale), CovarianceSaved(quaternion, log_scale, scale)


def covariance_reverse(d_shape: Shape, saved: CovarianceSaved) -> CovarianceGrads:
    """Gradients by quaternion and log-scale from those by rotation (all nine entries independent) and scale."""
    n = saved.quaternion.shape[1]
    d_out = np.empty((7, n), saved.quaternion.dtype)
    parallel_for(_reverse_kernel, n, *saved, d_shape.rotation, d_shape.scale, d_out)
    return CovarianceGrads(d_out[:4], d_out[4:])


def covariance_degenerate(quaternion: FloatArray, log_scale: FloatArray) -> tuple[int, int]:
    """How many quaternions are zero and how many log-scales are clipped."""
    zero = int(np.sum(~np.any(quaternion != 0, axis=0)))
    return zero, int(np.sum(np.abs(log_scale) > LOG_SCALE_LIMIT))


def covariance_matrix(shape: Shape) -> FloatArray:
    """Sigma itself, (3, 3, N), scene units squared; for oracles and exports, not used by the rasteriser."""
    factor = shape.rotation * shape.scale
    return np.einsum("ikn,jkn->ijn", factor, factor)
