"""Perspective (EWA) projection of Gaussians: screen mean, 2-D covariance and its determinant, view depth (B3).

With T = J W R (J the Jacobian of the projection at the centre, W the camera rotation) and S the semi-axes,
the screen covariance is (T S)(T S)^T + low_pass I = [[a, b], [b, c]]. Its determinant is formed as a sum of
non-negative terms, low_pass^2 + low_pass |T S|^2 + sum_{k<l} (s_k s_l (t_k x t_l))^2, because a c - b^2
loses every digit for a needle seen at an angle.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.jit import jit
from endotsr.sharing import share
from endotsr.splatting.camera import Camera, CameraGrads
from endotsr.splatting.covariance import Shape
from endotsr.splatting.settings import RasterSettings
from endotsr.vectors import local_array

FloatArray = NDArray[np.floating]

AXES = 3
BLOCK = 256  # Gaussians whose pose gradients are added up together
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


def _project(
    first, stop, position, rotation, scale, constants, pose, mean2d, covariance2d, determinant, depth, visible
):
    fx, fy, cx, cy, low_pass, near = constants[0], constants[1], constants[2], constants[3], constants[4], constants[5]
    limit_x, limit_y, axis_limit = constants[6], constants[7], constants[9]
    real = position.dtype.type
    one, zero = real(1), real(0)
    t0, t1, s = local_array(AXES, position), local_array(AXES, position), local_array(AXES, position)
    for i in range(np.uintp(first), np.uintp(stop)):  # unsigned: no index may count from the end
        px, py, pz = position[0, i], position[1, i], position[2, i]
        x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
        y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        visible[i] = False
        mean2d[0, i] = mean2d[1, i] = depth[i] = determinant[i] = zero
        covariance2d[0, i] = covariance2d[1, i] = covariance2d[2, i] = zero
        if not z > near:
            continue
        inverse_z = one / z
        slope_x, slope_y = x * inverse_z, y * inverse_z
        mean_x, mean_y = fx * slope_x + cx, fy * slope_y + cy
        slope_x = min(max(slope_x, -limit_x), limit_x)
        slope_y = min(max(slope_y, -limit_y), limit_y)
        j00, j02 = fx * inverse_z, -fx * slope_x * inverse_z
        j11, j12 = fy * inverse_z, -fy * slope_y * inverse_z
        m00, m01, m02 = (
            j00 * pose[0, 0] + j02 * pose[2, 0],
            j00 * pose[0, 1] + j02 * pose[2, 1],
            j00 * pose[0, 2] + j02 * pose[2, 2],
        )
        m10, m11, m12 = (
            j11 * pose[1, 0] + j12 * pose[2, 0],
            j11 * pose[1, 1] + j12 * pose[2, 1],
            j11 * pose[1, 2] + j12 * pose[2, 2],
        )
        a, b, c, spread = low_pass, zero, low_pass, zero
        for k in range(3):
            t0[k] = m00 * rotation[0, k, i] + m01 * rotation[1, k, i] + m02 * rotation[2, k, i]
            t1[k] = m10 * rotation[0, k, i] + m11 * rotation[1, k, i] + m12 * rotation[2, k, i]
            length = abs(t0[k]) + abs(t1[k])
            s[k] = scale[k, i]
            if s[k] * length > axis_limit:
                s[k] = axis_limit / length
            u, v = t0[k] * s[k], t1[k] * s[k]
            a += u * u
            b += u * v
            c += v * v
            spread += u * u + v * v
        areas = zero
        for k in range(3):
            n = (k + 1) % 3
            area = s[k] * s[n] * (t0[k] * t1[n] - t0[n] * t1[k])
            areas += area * area
        det = low_pass * low_pass + low_pass * spread + areas
        # a centre out of range, or any NaN or infinity: not drawn, so that no index is ever made of such a number
        if not (abs(mean_x) <= axis_limit and abs(mean_y) <= axis_limit and math.isfinite(det + z)):
            continue
        visible[i] = True
        mean2d[0, i], mean2d[1, i], depth[i], determinant[i] = mean_x, mean_y, z, det
        covariance2d[0, i], covariance2d[1, i], covariance2d[2, i] = a, b, c


def _project_reverse(
    first, last, position, rotation, scale, constants, pose, visible, determinant, d_mean2d, d_footprint, d_depth,
    d_position, d_rotation, d_scale, d_poses,
):  # fmt: skip
    """`d_poses` holds one (3, 4) sum per block, folded in block order by the caller; or (0, 3, 4) for none."""
    fx, fy, low_pass = constants[0], constants[1], constants[4]
    limit_x, limit_y, clamp_factor, axis_limit = constants[6], constants[7], constants[8], constants[9]
    real = position.dtype.type
    one, two, zero = real(1), real(2), real(0)
    jw0, jw1 = local_array(AXES, position), local_array(AXES, position)  # rows of J W
    d_jw0, d_jw1 = local_array(AXES, position), local_array(AXES, position)
    t0, t1, s = local_array(AXES, position), local_array(AXES, position), local_array(AXES, position)
    small = local_array(AXES, position)
    for i in range(np.uintp(first * BLOCK), np.uintp(min(position.shape[1], last * BLOCK))):
        for k in range(3):
            d_position[k, i] = d_scale[k, i] = zero
            d_rotation[k, 0, i] = d_rotation[k, 1, i] = d_rotation[k, 2, i] = zero
        if not visible[i]:
            continue
        px, py, pz = position[0, i], position[1, i], position[2, i]
        x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
        y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        inverse_z = one / z
        raw_x, raw_y = x * inverse_z, y * inverse_z
        slope_x, slope_y = min(max(raw_x, -limit_x), limit_x), min(max(raw_y, -limit_y), limit_y)
        j00, j02 = fx * inverse_z, -fx * slope_x * inverse_z
        j11, j12 = fy * inverse_z, -fy * slope_y * inverse_z
        for k in range(3):
            jw0[k] = j00 * pose[0, k] + j02 * pose[2, k]
            jw1[k] = j11 * pose[1, k] + j12 * pose[2, k]
            d_jw0[k] = d_jw1[k] = zero
        b, c = zero, low_pass
        for k in range(3):
            t0[k] = jw0[0] * rotation[0, k, i] + jw0[1] * rotation[1, k, i] + jw0[2] * rotation[2, k, i]
            t1[k] = jw1[0] * rotation[0, k, i] + jw1[1] * rotation[1, k, i] + jw1[2] * rotation[2, k, i]
            length = abs(t0[k]) + abs(t1[k])
            s[k] = scale[k, i] if scale[k, i] * length <= axis_limit else axis_limit / length
            b += (t0[k] * s[k]) * (t1[k] * s[k])
            c += (t1[k] * s[k]) * (t1[k] * s[k])
        m, r, precision = b / c, one / c, c / determinant[i]
        g_a = two * precision * precision * d_footprint[0, i]
        g_m, g_r = r * d_footprint[1, i], two * r * r * d_footprint[2, i]
        # e = t0 - m t1 without cancellation: along a needle it is small, and it is all that the length feels
        x01, x12, x20 = t0[0] * t1[1] - t0[1] * t1[0], t0[1] * t1[2] - t0[2] * t1[1], t0[2] * t1[0] - t0[0] * t1[2]
        w0, w1, w2 = (t1[0] * s[0]) * s[0], (t1[1] * s[1]) * s[1], (t1[2] * s[2]) * s[2]
        small[0] = r * (low_pass * t0[0] + w1 * x01 - w2 * x20)
        small[1] = r * (low_pass * t0[1] + w2 * x12 - w0 * x01)
        small[2] = r * (low_pass * t0[2] + w0 * x20 - w1 * x12)
        for k in range(3):
            if scale[k, i] * (abs(t0[k]) + abs(t1[k])) > axis_limit:
                continue  # clipped axis: constant
            e = small[k]
            d_t0 = s[k] * s[k] * (g_m * t1[k] - g_a * e)
            d_t1 = s[k] * s[k] * (g_a * m * e + g_m * (e - m * t1[k]) - g_r * t1[k])
            d_scale[k, i] = s[k] * (two * g_m * t1[k] * e - g_a * e * e - g_r * t1[k] * t1[k])
            for j in range(3):
                d_rotation[j, k, i] = jw0[j] * d_t0 + jw1[j] * d_t1
                d_jw0[j] += d_t0 * rotation[j, k, i]
                d_jw1[j] += d_t1 * rotation[j, k, i]
        d_j00 = d_jw0[0] * pose[0, 0] + d_jw0[1] * pose[0, 1] + d_jw0[2] * pose[0, 2]
        d_j02 = d_jw0[0] * pose[2, 0] + d_jw0[1] * pose[2, 1] + d_jw0[2] * pose[2, 2]
        d_j11 = d_jw1[0] * pose[1, 0] + d_jw1[1] * pose[1, 1] + d_jw1[2] * pose[1, 2]
        d_j12 = d_jw1[0] * pose[2, 0] + d_jw1[1] * pose[2, 1] + d_jw1[2] * pose[2, 2]
        # J02 = -fx clip(x/z) / z: free, it depends on x and twice on z; clamped, only once on z
        inverse_z2 = inverse_z * inverse_z
        free_x, free_y = abs(raw_x) <= limit_x, abs(raw_y) <= limit_y
        power_x = two if free_x else clamp_factor
        power_y = two if free_y else clamp_factor
        d_x = -fx * inverse_z2 * d_j02 if free_x else zero
        d_y = -fy * inverse_z2 * d_j12 if free_y else zero
        d_z = (
            inverse_z2 * (fx * (power_x * slope_x * d_j02 - d_j00) + fy * (power_y * slope_y * d_j12 - d_j11))
            + d_depth[i]
        )
        d_u, d_v = d_mean2d[0, i] * fx * inverse_z, d_mean2d[1, i] * fy * inverse_z
        d_x += d_u
        d_y += d_v
        d_z -= d_u * raw_x + d_v * raw_y
        for k in range(3):
            d_position[k, i] = pose[0, k] * d_x + pose[1, k] * d_y + pose[2, k] * d_z
        if d_poses.shape[1] > 0:
            d_pose = d_poses[i // np.uintp(BLOCK)]
            for k in range(3):
                p = position[k, i]
                d_pose[0, k] += j00 * d_jw0[k] + d_x * p
                d_pose[1, k] += j11 * d_jw1[k] + d_y * p
                d_pose[2, k] += j02 * d_jw0[k] + j12 * d_jw1[k] + d_z * p
            d_pose[0, 3] += d_x
            d_pose[1, 3] += d_y
            d_pose[2, 3] += d_z


_project_kernel = jit(_project)
_project_reverse_kernel = jit(_project_reverse)


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
    share(_project_kernel, n, position, shape.rotation, shape.scale, constants, pose, *out)
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
    d_poses = np.zeros(((n + BLOCK - 1) // BLOCK, 3 if pose_gradient else 0, 4), dtype)
    share(
        _project_reverse_kernel, d_poses.shape[0],
        saved.position, saved.shape.rotation, saved.shape.scale, saved.constants, saved.pose,
        saved.projected.visible, saved.projected.determinant, d_mean2d, d_footprint, d_depth,
        d_position, d_rotation, d_scale, d_poses,
    )  # fmt: skip
    camera = None
    if pose_gradient:
        d_pose = d_poses.sum(axis=0)
        camera = CameraGrads(d_pose[:, :3].copy(), d_pose[:, 3].copy())
    return ProjectionGrads(d_position, d_rotation, d_scale, camera)
