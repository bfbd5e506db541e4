"""Kernels of the projection, forward and reverse: a group of Gaussians at a time, as vector code.

The results of a group wait in a local array (`vectors`). No store in the loop over the group can then change what the
loop reads, so the compiler needs no proof that two dozen arrays do not overlap, and the loop becomes vector code: a
third of the time of one Gaussian after the other. Selects take the place of branches; a Gaussian that is not drawn is
computed with harmless numbers (z = 1, determinant 1) and then set to zero.
"""

import math

import numpy as np

from endotsr.kernels.jit import jit, jit_inline
from endotsr.kernels.vectors import GROUP, local_array, write_group

AXES = 3
POSES_PER_SUM = 256  # Gaussians whose pose gradients are added up together
# Where the columns of a group's results begin. Forward: mean, covariance, determinant, depth, whether it is drawn.
U, V, A, B, C, DET, Z, DRAWN = 0, GROUP, 2 * GROUP, 3 * GROUP, 4 * GROUP, 5 * GROUP, 6 * GROUP, 7 * GROUP
PROJECTED = 8 * GROUP
# Reverse: by position, scale, rotation; and for the pose: by J W, the entries J00, J11, J02, J12, by the view position.
D_POSITION, D_SCALE, D_ROTATION = 0, 3 * GROUP, 6 * GROUP
JW, JACOBIAN, VIEW = 15, 21, 25  # columns
D_JW, D_JACOBIAN, D_VIEW = JW * GROUP, JACOBIAN * GROUP, VIEW * GROUP
WITHOUT_POSE, WITH_POSE = JW, VIEW + AXES  # columns
GRADIENTS = WITH_POSE * GROUP

_U64 = np.uint64  # no index may count from the end


def _to_view(pose, x, y, z):
    """A point in the axes of the camera."""
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3],
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3],
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3],
    )


_to_view_kernel = jit_inline(_to_view)


def _project(first, stop, position, rotation, scale, constants, pose, out, visible):
    """`out` (7, N): mean, covariance, determinant, depth; zero where not visible."""
    fx, fy, cx, cy, low_pass, near = constants[0], constants[1], constants[2], constants[3], constants[4], constants[5]
    limit_x, limit_y, axis_limit = constants[6], constants[7], constants[9]
    one, zero = position.dtype.type(1), position.dtype.type(0)
    t0, t1, s = local_array(AXES, position), local_array(AXES, position), local_array(AXES, position)
    results = local_array(PROJECTED, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for lane in range(count):
            i = _U64(start + lane)
            x, y, z = _to_view_kernel(pose, position[0, i], position[1, i], position[2, i])
            drawn = z > near
            inverse_z = one / (z if drawn else one)
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
            for axis in range(3):
                t0[axis] = m00 * rotation[0, axis, i] + m01 * rotation[1, axis, i] + m02 * rotation[2, axis, i]
                t1[axis] = m10 * rotation[0, axis, i] + m11 * rotation[1, axis, i] + m12 * rotation[2, axis, i]
                length = abs(t0[axis]) + abs(t1[axis])
                semi_axis = scale[axis, i]
                s[axis] = semi_axis if not semi_axis * length > axis_limit else axis_limit / length
                u, v = t0[axis] * s[axis], t1[axis] * s[axis]
                a += u * u
                b += u * v
                c += v * v
                spread += u * u + v * v
            areas = zero
            for axis in range(3):
                n = (axis + 1) % 3
                area = s[axis] * s[n] * (t0[axis] * t1[n] - t0[n] * t1[axis])
                areas += area * area
            det = low_pass * low_pass + low_pass * spread + areas
            # a centre out of range, or any NaN or infinity: not drawn, so that no index is made of such a number
            drawn = drawn & (abs(mean_x) <= axis_limit) & (abs(mean_y) <= axis_limit) & math.isfinite(det + z)
            results[_U64(U + lane)] = mean_x if drawn else zero
            results[_U64(V + lane)] = mean_y if drawn else zero
            results[_U64(A + lane)] = a if drawn else zero
            results[_U64(B + lane)] = b if drawn else zero
            results[_U64(C + lane)] = c if drawn else zero
            results[_U64(DET + lane)] = det if drawn else zero
            results[_U64(Z + lane)] = z if drawn else zero
            results[_U64(DRAWN + lane)] = one if drawn else zero
        write_group(results, start, count, out)
        for lane in range(count):
            visible[_U64(start + lane)] = results[_U64(DRAWN + lane)] > zero


def _project_reverse(
    first, stop, position, rotation, scale, constants, pose, visible, determinant, d_mean2d, d_footprint, d_depth,
    d_out,
):  # fmt: skip
    """`d_out` (15, N): gradients by position, scale, rotation; (28, N): and what `_pose_reverse` adds up."""
    fx, fy, low_pass = constants[0], constants[1], constants[4]
    limit_x, limit_y, clamp_factor, axis_limit = constants[6], constants[7], constants[8], constants[9]
    one, two, zero = position.dtype.type(1), position.dtype.type(2), position.dtype.type(0)
    jw0, jw1 = local_array(AXES, position), local_array(AXES, position)  # rows of J W
    d_jw0, d_jw1 = local_array(AXES, position), local_array(AXES, position)
    t0, t1, s = local_array(AXES, position), local_array(AXES, position), local_array(AXES, position)
    small = local_array(AXES, position)
    results = local_array(GRADIENTS, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for lane in range(count):
            i = _U64(start + lane)
            seen = visible[i]
            x, y, z = _to_view_kernel(pose, position[0, i], position[1, i], position[2, i])
            inverse_z = one / (z if seen else one)
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
            m, r, precision = b / c, one / c, c / (determinant[i] if seen else one)
            g_a = two * precision * precision * d_footprint[0, i]
            g_m, g_r = r * d_footprint[1, i], two * r * r * d_footprint[2, i]
            # e = t0 - m t1 without cancellation: along a needle it is small, and it is all that the length feels
            x01, x12, x20 = t0[0] * t1[1] - t0[1] * t1[0], t0[1] * t1[2] - t0[2] * t1[1], t0[2] * t1[0] - t0[0] * t1[2]
            w0, w1, w2 = (t1[0] * s[0]) * s[0], (t1[1] * s[1]) * s[1], (t1[2] * s[2]) * s[2]
            small[0] = r * (low_pass * t0[0] + w1 * x01 - w2 * x20)
            small[1] = r * (low_pass * t0[1] + w2 * x12 - w0 * x01)
            small[2] = r * (low_pass * t0[2] + w0 * x20 - w1 * x12)
            for k in range(3):
                free = scale[k, i] * (abs(t0[k]) + abs(t1[k])) <= axis_limit  # a clipped axis is constant
                felt = seen & free
                e = small[k]
                d_t0 = s[k] * s[k] * (g_m * t1[k] - g_a * e) if felt else zero
                d_t1 = s[k] * s[k] * (g_a * m * e + g_m * (e - m * t1[k]) - g_r * t1[k]) if felt else zero
                d_s = s[k] * (two * g_m * t1[k] * e - g_a * e * e - g_r * t1[k] * t1[k]) if felt else zero
                results[_U64(D_SCALE + k * GROUP + lane)] = d_s
                for j in range(3):
                    d_r = jw0[j] * d_t0 + jw1[j] * d_t1 if felt else zero
                    results[_U64(D_ROTATION + (3 * j + k) * GROUP + lane)] = d_r
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
                d_p = pose[0, k] * d_x + pose[1, k] * d_y + pose[2, k] * d_z
                results[_U64(D_POSITION + k * GROUP + lane)] = d_p if seen else zero
                results[_U64(D_JW + k * GROUP + lane)] = d_jw0[k]
                results[_U64(D_JW + (3 + k) * GROUP + lane)] = d_jw1[k]
            results[_U64(D_JACOBIAN + lane)], results[_U64(D_JACOBIAN + GROUP + lane)] = j00, j11
            results[_U64(D_JACOBIAN + 2 * GROUP + lane)], results[_U64(D_JACOBIAN + 3 * GROUP + lane)] = j02, j12
            results[_U64(D_VIEW + lane)], results[_U64(D_VIEW + GROUP + lane)] = d_x, d_y
            results[_U64(D_VIEW + 2 * GROUP + lane)] = d_z
        write_group(results, start, count, d_out)


def _pose_reverse(first, last, position, visible, d_out, d_poses):
    """One (3, 4) sum per block of the visible Gaussians, in their order; the caller adds up the blocks."""
    for block in range(first, last):
        d_pose = d_poses[block]
        for i in range(block * POSES_PER_SUM, min(position.shape[1], (block + 1) * POSES_PER_SUM)):
            if not visible[i]:
                continue
            d_jw0, d_jw1 = d_out[JW:, i], d_out[JW + AXES :, i]
            jacobian, d_view = d_out[JACOBIAN:, i], d_out[VIEW:, i]
            for k in range(AXES):
                p = position[k, i]
                d_pose[0, k] += jacobian[0] * d_jw0[k] + d_view[0] * p
                d_pose[1, k] += jacobian[1] * d_jw1[k] + d_view[1] * p
                d_pose[2, k] += jacobian[2] * d_jw0[k] + jacobian[3] * d_jw1[k] + d_view[2] * p
                d_pose[k, 3] += d_view[k]


project_kernel, project_reverse_kernel = jit(_project), jit(_project_reverse)
pose_reverse_kernel = jit(_pose_reverse)
