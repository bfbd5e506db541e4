"""Perspective (EWA) projection of Gaussians: screen mean, 2-D covariance and its determinant, view depth (B3).

With T = J W R (J the Jacobian of the projection at the centre, W the camera rotation) and S the semi-axes,
the screen covariance is (T S)(T S)^T + low_pass I = [[a, b], [b, c]]. Its determinant is formed as a sum of
non-negative terms, low_pass^2 + low_pass |T S|^2 + sum_{k<l} (s_k s_l (t_k x t_l))^2, because a c - b^2
loses every digit for a needle seen at an angle.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.jit import jit, jit_inline
from endotsr.sharing import share
from endotsr.splatting.camera import Camera, CameraGrads
from endotsr.splatting.covariance import Shape
from endotsr.splatting.settings import RasterSettings

FloatArray = NDArray[np.floating]

BLOCK = 256  # Gaussians worked on together; their pose gradients are added up
# px. A projected semi-axis beyond this is clipped (zero gradient to it): its square and the determinant stay finite.
# A centre farther out is not drawn.
AXIS_LIMIT = {np.dtype(np.float32): 1e8, np.dtype(np.float64): 1e60}


class Projected(NamedTuple):
    """Gaussians on the screen. Entries of invisible Gaussians are zero."""

    mean2d: FloatArray  # (2, N) px
    covariance2d: FloatArray  # (3, N) a, b, c in px^2, low-pass included
    determinant: FloatArray  # (N,) a c - b^2 in px^4, formed without cancellation
    depth: FloatArray  # (N,) view-space z, scene units
    visible: NDArray[np.bool_]  # (N,) z > near, centre within the axis limit, all entries finite


class ProjectionSaved(NamedTuple):
    """Inputs and outputs of the forward pass."""

    position: FloatArray
    shape: Shape
    camera: Camera
    constants: FloatArray
    pose: FloatArray
    projected: Projected


def footprint(projected: Projected) -> FloatArray:
    """A = c/det, m = b/c, r = 1/c (3, N): the exponent is -(r dy^2 + A (dx - m dy)^2)/2; zero where not visible."""
    seen = projected.visible
    b, c = projected.covariance2d[1, seen], projected.covariance2d[2, seen]
    out = np.zeros_like(projected.covariance2d)
    out[:, seen] = c / projected.determinant[seen], b / c, 1 / c
    return out


class ProjectionGrads(NamedTuple):
    """Gradients of the projection. `camera` is None unless it was asked for."""

    position: FloatArray  # (3, N)
    rotation: FloatArray  # (3, 3, N)
    scale: FloatArray  # (3, N)
    camera: CameraGrads | None


def _constants(camera: Camera, settings: RasterSettings, dtype) -> FloatArray:
    """fx, fy, cx, cy, low-pass, near, off-axis limits in x and y (0 = none), factor of the clamp term, axis limit."""
    limit = settings.jacobian_clamp
    return np.array(
        [
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            settings.low_pass,
            settings.near,
            limit * camera.width / (2 * camera.fx) if limit > 0 else np.inf,
            limit * camera.height / (2 * camera.fy) if limit > 0 else np.inf,
            2.0 if settings.deviations.double_clamp_term else 1.0,
            AXIS_LIMIT[np.dtype(dtype)],
        ],
        dtype,
    )


# A block of Gaussians stands in one flat array, plane k at k * BLOCK, indexed with unsigned integers and without a
# branch: no alias or wrap-around checks, so the loops become vector code. Gradients replace what they belong to.
_POSITION, _ROTATION, _SCALE, _DETERMINANT, _SEEN = 0, 3, 12, 15, 16
_MEAN, _COVARIANCE, _DEPTH = 17, 19, 22  # of the forward pass, and their gradients in the reverse pass
_POSE = 23  # 12 planes: what a Gaussian adds to the gradient of [rotation | translation], row by row
_U64 = np.uint64


def _read(rows, start, planes, plane):
    """Columns start ... start + BLOCK - 1 of some rows to consecutive planes."""
    for k in range(rows.shape[0]):
        row, at = rows[k, start : start + BLOCK], _U64((plane + k) * BLOCK)
        for i in range(row.size):
            planes[at + _U64(i)] = row[i]


def _write(planes, plane, rows, start):
    """The way back of `_read`."""
    for k in range(rows.shape[0]):
        row, at = rows[k, start : start + BLOCK], _U64((plane + k) * BLOCK)
        for i in range(row.size):
            row[i] = planes[at + _U64(i)]


def _axis(m00, m01, m02, m10, m11, m12, r0, r1, r2, scale, axis_limit):
    """A semi-axis on the screen: its direction (t0, t1), its length factor, and whether that is clipped."""
    t0, t1 = m00 * r0 + m01 * r1 + m02 * r2, m10 * r0 + m11 * r1 + m12 * r2
    length = abs(t0) + abs(t1)
    clipped = scale * length > axis_limit  # not for a NaN, which must not become a number
    return t0, t1, axis_limit / length if clipped else scale, clipped


_read_kernel, _write_kernel, _axis_kernel = jit(_read), jit(_write), jit_inline(_axis)


def _project(planes, count, constants, pose):
    """Mean, covariance, determinant, depth of `count` Gaussians; zero, and _SEEN zero, where one is not drawn."""
    real = planes.dtype.type
    one, zero = real(1), real(0)
    fx, fy, cx, cy, low_pass, near = constants[0], constants[1], constants[2], constants[3], constants[4], constants[5]
    limit_x, limit_y, axis_limit = constants[6], constants[7], constants[9]
    p00, p01, p02, p03 = pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3]
    p10, p11, p12, p13 = pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3]
    p20, p21, p22, p23 = pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3]
    for index in range(count):
        i = _U64(index)
        px, py, pz = planes[i], planes[i + _U64(BLOCK)], planes[i + _U64(2 * BLOCK)]
        x = p00 * px + p01 * py + p02 * pz + p03
        y = p10 * px + p11 * py + p12 * pz + p13
        z = p20 * px + p21 * py + p22 * pz + p23
        inverse_z = one / z
        slope_x, slope_y = x * inverse_z, y * inverse_z
        mean_x, mean_y = fx * slope_x + cx, fy * slope_y + cy
        slope_x = min(max(slope_x, -limit_x), limit_x)
        slope_y = min(max(slope_y, -limit_y), limit_y)
        j00, j02 = fx * inverse_z, -fx * slope_x * inverse_z
        j11, j12 = fy * inverse_z, -fy * slope_y * inverse_z
        m00, m01, m02 = j00 * p00 + j02 * p20, j00 * p01 + j02 * p21, j00 * p02 + j02 * p22
        m10, m11, m12 = j11 * p10 + j12 * p20, j11 * p11 + j12 * p21, j11 * p12 + j12 * p22
        t00, t10, s0, _ = _axis_kernel(
            m00, m01, m02, m10, m11, m12,
            planes[i + _U64(_ROTATION * BLOCK)], planes[i + _U64((_ROTATION + 3) * BLOCK)],
            planes[i + _U64((_ROTATION + 6) * BLOCK)], planes[i + _U64(_SCALE * BLOCK)], axis_limit,
        )  # fmt: skip
        t01, t11, s1, _ = _axis_kernel(
            m00, m01, m02, m10, m11, m12,
            planes[i + _U64((_ROTATION + 1) * BLOCK)], planes[i + _U64((_ROTATION + 4) * BLOCK)],
            planes[i + _U64((_ROTATION + 7) * BLOCK)], planes[i + _U64((_SCALE + 1) * BLOCK)], axis_limit,
        )  # fmt: skip
        t02, t12, s2, _ = _axis_kernel(
            m00, m01, m02, m10, m11, m12,
            planes[i + _U64((_ROTATION + 2) * BLOCK)], planes[i + _U64((_ROTATION + 5) * BLOCK)],
            planes[i + _U64((_ROTATION + 8) * BLOCK)], planes[i + _U64((_SCALE + 2) * BLOCK)], axis_limit,
        )  # fmt: skip
        u0, v0, u1, v1, u2, v2 = t00 * s0, t10 * s0, t01 * s1, t11 * s1, t02 * s2, t12 * s2
        a = low_pass + u0 * u0 + u1 * u1 + u2 * u2
        b = u0 * v0 + u1 * v1 + u2 * v2
        c = low_pass + v0 * v0 + v1 * v1 + v2 * v2
        spread = (u0 * u0 + v0 * v0) + (u1 * u1 + v1 * v1) + (u2 * u2 + v2 * v2)
        area0 = s0 * s1 * (t00 * t11 - t01 * t10)
        area1 = s1 * s2 * (t01 * t12 - t02 * t11)
        area2 = s2 * s0 * (t02 * t10 - t00 * t12)
        determinant = low_pass * low_pass + low_pass * spread + (area0 * area0 + area1 * area1 + area2 * area2)
        # a centre out of range, or any NaN or infinity: not drawn, so that no index is ever made of such a number
        finite = determinant + z - (determinant + z) == zero
        seen = (z > near) & (abs(mean_x) <= axis_limit) & (abs(mean_y) <= axis_limit) & finite
        planes[i + _U64(_SEEN * BLOCK)] = one if seen else zero
        planes[i + _U64(_MEAN * BLOCK)] = mean_x if seen else zero
        planes[i + _U64((_MEAN + 1) * BLOCK)] = mean_y if seen else zero
        planes[i + _U64(_COVARIANCE * BLOCK)] = a if seen else zero
        planes[i + _U64((_COVARIANCE + 1) * BLOCK)] = b if seen else zero
        planes[i + _U64((_COVARIANCE + 2) * BLOCK)] = c if seen else zero
        planes[i + _U64(_DETERMINANT * BLOCK)] = determinant if seen else zero
        planes[i + _U64(_DEPTH * BLOCK)] = z if seen else zero


def _axis_reverse(t0, t1, s, clipped, small, m, g_a, g_m, g_r, two, zero):
    """Gradients by t0, t1 and log of the semi-axis; a clipped axis is constant. `small` is e = t0 - m t1."""
    d_t0 = s * s * (g_m * t1 - g_a * small)
    d_t1 = s * s * (g_a * m * small + g_m * (small - m * t1) - g_r * t1)
    d_s = s * (two * g_m * t1 * small - g_a * small * small - g_r * t1 * t1)
    return zero if clipped else d_t0, zero if clipped else d_t1, zero if clipped else d_s


_axis_reverse_kernel = jit_inline(_axis_reverse)


def _project_reverse(planes, count, constants, pose):
    """Gradients of `count` Gaussians in place of position, rotation and scale, and their shares of that of the pose."""
    real = planes.dtype.type
    one, two, zero = real(1), real(2), real(0)
    fx, fy, low_pass = constants[0], constants[1], constants[4]
    limit_x, limit_y, clamp_factor, axis_limit = constants[6], constants[7], constants[8], constants[9]
    p00, p01, p02, p03 = pose[0, 0], pose[0, 1], pose[0, 2], pose[0, 3]
    p10, p11, p12, p13 = pose[1, 0], pose[1, 1], pose[1, 2], pose[1, 3]
    p20, p21, p22, p23 = pose[2, 0], pose[2, 1], pose[2, 2], pose[2, 3]
    for index in range(count):
        i = _U64(index)
        px, py, pz = planes[i], planes[i + _U64(BLOCK)], planes[i + _U64(2 * BLOCK)]
        seen = planes[i + _U64(_SEEN * BLOCK)] > zero
        x = p00 * px + p01 * py + p02 * pz + p03
        y = p10 * px + p11 * py + p12 * pz + p13
        z = p20 * px + p21 * py + p22 * pz + p23
        inverse_z = one / z
        raw_x, raw_y = x * inverse_z, y * inverse_z
        slope_x, slope_y = min(max(raw_x, -limit_x), limit_x), min(max(raw_y, -limit_y), limit_y)
        j00, j02 = fx * inverse_z, -fx * slope_x * inverse_z
        j11, j12 = fy * inverse_z, -fy * slope_y * inverse_z
        m00, m01, m02 = j00 * p00 + j02 * p20, j00 * p01 + j02 * p21, j00 * p02 + j02 * p22
        m10, m11, m12 = j11 * p10 + j12 * p20, j11 * p11 + j12 * p21, j11 * p12 + j12 * p22
        r00, r01 = planes[i + _U64(_ROTATION * BLOCK)], planes[i + _U64((_ROTATION + 1) * BLOCK)]
        r02, r10 = planes[i + _U64((_ROTATION + 2) * BLOCK)], planes[i + _U64((_ROTATION + 3) * BLOCK)]
        r11, r12 = planes[i + _U64((_ROTATION + 4) * BLOCK)], planes[i + _U64((_ROTATION + 5) * BLOCK)]
        r20, r21 = planes[i + _U64((_ROTATION + 6) * BLOCK)], planes[i + _U64((_ROTATION + 7) * BLOCK)]
        r22 = planes[i + _U64((_ROTATION + 8) * BLOCK)]
        scale0, scale1 = planes[i + _U64(_SCALE * BLOCK)], planes[i + _U64((_SCALE + 1) * BLOCK)]
        scale2 = planes[i + _U64((_SCALE + 2) * BLOCK)]
        t00, t10, s0, clipped0 = _axis_kernel(m00, m01, m02, m10, m11, m12, r00, r10, r20, scale0, axis_limit)
        t01, t11, s1, clipped1 = _axis_kernel(m00, m01, m02, m10, m11, m12, r01, r11, r21, scale1, axis_limit)
        t02, t12, s2, clipped2 = _axis_kernel(m00, m01, m02, m10, m11, m12, r02, r12, r22, scale2, axis_limit)
        v0, v1, v2 = t10 * s0, t11 * s1, t12 * s2
        b = (t00 * s0) * v0 + (t01 * s1) * v1 + (t02 * s2) * v2
        c = low_pass + v0 * v0 + v1 * v1 + v2 * v2
        m, r, precision = b / c, one / c, c / planes[i + _U64(_DETERMINANT * BLOCK)]
        g_a = two * precision * precision * planes[i + _U64(_COVARIANCE * BLOCK)]
        g_m = r * planes[i + _U64((_COVARIANCE + 1) * BLOCK)]
        g_r = two * r * r * planes[i + _U64((_COVARIANCE + 2) * BLOCK)]
        # e = t0 - m t1 without cancellation: along a needle it is small, and it is all that the length feels
        x01, x12, x20 = t00 * t11 - t01 * t10, t01 * t12 - t02 * t11, t02 * t10 - t00 * t12
        w0, w1, w2 = v0 * s0, v1 * s1, v2 * s2
        e0 = r * (low_pass * t00 + w1 * x01 - w2 * x20)
        e1 = r * (low_pass * t01 + w2 * x12 - w0 * x01)
        e2 = r * (low_pass * t02 + w0 * x20 - w1 * x12)
        a0, b0, d_s0 = _axis_reverse_kernel(t00, t10, s0, clipped0, e0, m, g_a, g_m, g_r, two, zero)
        a1, b1, d_s1 = _axis_reverse_kernel(t01, t11, s1, clipped1, e1, m, g_a, g_m, g_r, two, zero)
        a2, b2, d_s2 = _axis_reverse_kernel(t02, t12, s2, clipped2, e2, m, g_a, g_m, g_r, two, zero)
        planes[i + _U64(_SCALE * BLOCK)] = d_s0 if seen else zero
        planes[i + _U64((_SCALE + 1) * BLOCK)] = d_s1 if seen else zero
        planes[i + _U64((_SCALE + 2) * BLOCK)] = d_s2 if seen else zero
        planes[i + _U64(_ROTATION * BLOCK)] = m00 * a0 + m10 * b0 if seen else zero
        planes[i + _U64((_ROTATION + 1) * BLOCK)] = m00 * a1 + m10 * b1 if seen else zero
        planes[i + _U64((_ROTATION + 2) * BLOCK)] = m00 * a2 + m10 * b2 if seen else zero
        planes[i + _U64((_ROTATION + 3) * BLOCK)] = m01 * a0 + m11 * b0 if seen else zero
        planes[i + _U64((_ROTATION + 4) * BLOCK)] = m01 * a1 + m11 * b1 if seen else zero
        planes[i + _U64((_ROTATION + 5) * BLOCK)] = m01 * a2 + m11 * b2 if seen else zero
        planes[i + _U64((_ROTATION + 6) * BLOCK)] = m02 * a0 + m12 * b0 if seen else zero
        planes[i + _U64((_ROTATION + 7) * BLOCK)] = m02 * a1 + m12 * b1 if seen else zero
        planes[i + _U64((_ROTATION + 8) * BLOCK)] = m02 * a2 + m12 * b2 if seen else zero
        # gradient of J W, its rows 0 and 1
        q00, q01, q02 = a0 * r00 + a1 * r01 + a2 * r02, a0 * r10 + a1 * r11 + a2 * r12, a0 * r20 + a1 * r21 + a2 * r22
        q10, q11, q12 = b0 * r00 + b1 * r01 + b2 * r02, b0 * r10 + b1 * r11 + b2 * r12, b0 * r20 + b1 * r21 + b2 * r22
        d_j00, d_j02 = q00 * p00 + q01 * p01 + q02 * p02, q00 * p20 + q01 * p21 + q02 * p22
        d_j11, d_j12 = q10 * p10 + q11 * p11 + q12 * p12, q10 * p20 + q11 * p21 + q12 * p22
        # J02 = -fx clip(x/z) / z: free, it depends on x and twice on z; clamped, only once on z
        inverse_z2 = inverse_z * inverse_z
        free_x, free_y = abs(raw_x) <= limit_x, abs(raw_y) <= limit_y
        power_x, power_y = two if free_x else clamp_factor, two if free_y else clamp_factor
        d_u = planes[i + _U64(_MEAN * BLOCK)] * fx * inverse_z
        d_v = planes[i + _U64((_MEAN + 1) * BLOCK)] * fy * inverse_z
        d_x = (-fx * inverse_z2 * d_j02 if free_x else zero) + d_u
        d_y = (-fy * inverse_z2 * d_j12 if free_y else zero) + d_v
        d_z = inverse_z2 * (fx * (power_x * slope_x * d_j02 - d_j00) + fy * (power_y * slope_y * d_j12 - d_j11))
        d_z += planes[i + _U64(_DEPTH * BLOCK)]
        d_z -= d_u * raw_x + d_v * raw_y
        planes[i] = p00 * d_x + p10 * d_y + p20 * d_z if seen else zero
        planes[i + _U64(BLOCK)] = p01 * d_x + p11 * d_y + p21 * d_z if seen else zero
        planes[i + _U64(2 * BLOCK)] = p02 * d_x + p12 * d_y + p22 * d_z if seen else zero
        planes[i + _U64(_POSE * BLOCK)] = j00 * q00 + d_x * px if seen else zero
        planes[i + _U64((_POSE + 1) * BLOCK)] = j00 * q01 + d_x * py if seen else zero
        planes[i + _U64((_POSE + 2) * BLOCK)] = j00 * q02 + d_x * pz if seen else zero
        planes[i + _U64((_POSE + 3) * BLOCK)] = d_x if seen else zero
        planes[i + _U64((_POSE + 4) * BLOCK)] = j11 * q10 + d_y * px if seen else zero
        planes[i + _U64((_POSE + 5) * BLOCK)] = j11 * q11 + d_y * py if seen else zero
        planes[i + _U64((_POSE + 6) * BLOCK)] = j11 * q12 + d_y * pz if seen else zero
        planes[i + _U64((_POSE + 7) * BLOCK)] = d_y if seen else zero
        planes[i + _U64((_POSE + 8) * BLOCK)] = j02 * q00 + j12 * q10 + d_z * px if seen else zero
        planes[i + _U64((_POSE + 9) * BLOCK)] = j02 * q01 + j12 * q11 + d_z * py if seen else zero
        planes[i + _U64((_POSE + 10) * BLOCK)] = j02 * q02 + j12 * q12 + d_z * pz if seen else zero
        planes[i + _U64((_POSE + 11) * BLOCK)] = d_z if seen else zero


_project_kernel, _project_reverse_kernel = jit(_project), jit(_project_reverse)


def _project_blocks(
    first, last, position, rotation, scale, constants, pose, mean2d, covariance2d, determinant, depth, visible
):
    """Blocks first ... last - 1; `rotation` (9, N), `determinant` and `depth` (1, N)."""
    planes = np.empty(_POSE * BLOCK, position.dtype)
    for block in range(first, last):
        start = block * BLOCK
        seen = visible[start : start + BLOCK]
        _read_kernel(position, start, planes, _POSITION)
        _read_kernel(rotation, start, planes, _ROTATION)
        _read_kernel(scale, start, planes, _SCALE)
        _project_kernel(planes, seen.size, constants, pose)
        _write_kernel(planes, _MEAN, mean2d, start)
        _write_kernel(planes, _COVARIANCE, covariance2d, start)
        _write_kernel(planes, _DETERMINANT, determinant, start)
        _write_kernel(planes, _DEPTH, depth, start)
        for i in range(seen.size):
            seen[i] = planes[_SEEN * BLOCK + i] > 0


def _project_reverse_blocks(
    first, last, position, rotation, scale, constants, pose, visible, determinant, d_mean2d, d_footprint, d_depth,
    d_position, d_rotation, d_scale, d_poses,
):  # fmt: skip
    """As `_project_blocks`; `d_poses` holds one (12,) sum per block, folded in block order by the caller."""
    planes = np.empty((_POSE + 12) * BLOCK, position.dtype)
    one, zero = position.dtype.type(1), position.dtype.type(0)
    for block in range(first, last):
        start = block * BLOCK
        seen = visible[start : start + BLOCK]
        _read_kernel(position, start, planes, _POSITION)
        _read_kernel(rotation, start, planes, _ROTATION)
        _read_kernel(scale, start, planes, _SCALE)
        _read_kernel(determinant, start, planes, _DETERMINANT)
        _read_kernel(d_mean2d, start, planes, _MEAN)
        _read_kernel(d_footprint, start, planes, _COVARIANCE)
        _read_kernel(d_depth, start, planes, _DEPTH)
        for i in range(seen.size):
            planes[_SEEN * BLOCK + i] = one if seen[i] else zero
        _project_reverse_kernel(planes, seen.size, constants, pose)
        _write_kernel(planes, _POSITION, d_position, start)
        _write_kernel(planes, _ROTATION, d_rotation, start)
        _write_kernel(planes, _SCALE, d_scale, start)
        for k in range(12):
            total = zero
            for i in range(seen.size):
                total += planes[(_POSE + k) * BLOCK + i]
            d_poses[block, k] = total


_project_blocks_kernel, _project_reverse_blocks_kernel = jit(_project_blocks), jit(_project_reverse_blocks)


def _blocks(n: int) -> int:
    return (n + BLOCK - 1) // BLOCK


def projection_forward(
    position: FloatArray, shape: Shape, camera: Camera, settings: RasterSettings
) -> tuple[Projected, ProjectionSaved]:
    """Project N Gaussians to the screen (specification B3).

    position  (3, N) world centre, scene units
    shape     factored covariance, `covariance_forward`
    camera    OpenCV axes, world-to-camera
    settings  low_pass (px^2), near (scene units), jacobian_clamp (x tan(fov/2))
    returns   Projected; Gaussians with z <= near are invisible and all their entries are zero

    Reverse: `projection_reverse`, through the mean, the Jacobian, the rotation and the pose.
    Edges:   a projected semi-axis above 1e8 px (float32; 1e60 in float64) is clipped with zero gradient; a centre
             farther out than that, and a Gaussian with a number that is not finite, are invisible.
    Oracle:  tests/oracle/splatting_oracle.py; determinant against mpmath.
    """
    dtype = position.dtype
    n = position.shape[1]
    constants = _constants(camera, settings, dtype)
    pose = np.ascontiguousarray(np.concatenate([camera.rotation, camera.translation[:, None]], axis=1), dtype)
    out = Projected(
        np.empty((2, n), dtype), np.empty((3, n), dtype), np.empty(n, dtype), np.empty(n, dtype), np.empty(n, np.bool_)
    )
    rotation, planar = shape.rotation.reshape(9, n), [np.atleast_2d(a) for a in out[:4]]
    share(_project_blocks_kernel, _blocks(n), position, rotation, shape.scale, constants, pose, *planar, out.visible)
    return out, ProjectionSaved(position, shape, camera, constants, pose, out)


def projection_reverse(
    d_mean2d: FloatArray,
    d_covariance2d: FloatArray,
    d_depth: FloatArray,
    saved: ProjectionSaved,
    *,
    pose_gradient: bool = False,
) -> ProjectionGrads:
    """Gradients by position, rotation, scale and, when asked for, the camera pose.

    d_mean2d        (2, N) dL/d(u, v), per px
    d_covariance2d  (3, N) dL/d(a, b, c), b counted once; the determinant's share is already inside (det = a c - b^2)
    d_depth         (N,)   dL/dz through the depth image
    """
    seen = saved.projected.visible
    precision, slope, inverse_c = footprint(saved.projected)[:, seen]
    g_a, g_b, g_c = d_covariance2d[:, seen]
    d_footprint = np.zeros_like(d_covariance2d)  # of a = 1/A + m^2/r, b = m/r, c = 1/r
    d_footprint[0, seen] = -g_a / (precision * precision)
    d_footprint[1, seen] = (2 * slope * g_a + g_b) / inverse_c
    d_footprint[2, seen] = -(slope * slope * g_a + slope * g_b + g_c) / (inverse_c * inverse_c)
    return projection_reverse_footprint(d_mean2d, d_footprint, d_depth, saved, pose_gradient=pose_gradient)


def projection_reverse_footprint(
    d_mean2d: FloatArray,
    d_footprint: FloatArray,
    d_depth: FloatArray,
    saved: ProjectionSaved,
    *,
    pose_gradient: bool = False,
) -> ProjectionGrads:
    """As `projection_reverse`, from the gradients (3, N) by A, m, r of `footprint`.

    The render takes this way: in gradients by a, b, c the length of a needle is lost, by (length / width)^2 roundings.
    """
    n = saved.position.shape[1]
    dtype = saved.position.dtype
    d_position, d_rotation = np.empty_like(saved.position), np.empty((3, 3, n), dtype)
    d_scale = np.empty((3, n), dtype)
    d_poses = np.empty((_blocks(n), 12), dtype)
    rotation, determinant = saved.shape.rotation.reshape(9, n), np.atleast_2d(saved.projected.determinant)
    share(
        _project_reverse_blocks_kernel, _blocks(n),
        saved.position, rotation, saved.shape.scale, saved.constants, saved.pose, saved.projected.visible, determinant,
        d_mean2d, d_footprint, np.atleast_2d(d_depth), d_position, d_rotation.reshape(9, n), d_scale, d_poses,
    )  # fmt: skip
    camera = None
    if pose_gradient:
        d_pose = d_poses.sum(axis=0).reshape(3, 4)
        camera = CameraGrads(d_pose[:, :3].copy(), d_pose[:, 3].copy())
    return ProjectionGrads(d_position, d_rotation, d_scale, camera)
