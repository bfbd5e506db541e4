"""Equation (B3): perspective projection of a Gaussian, by its covariance matrix and the Jacobian."""

from collections import namedtuple

import numpy as np

from endotsr.definition.covariance import covariance_matrix

# Pinhole camera: x_camera = rotation x_world + translation; x right, y down, z forward.
Camera = namedtuple("Camera", "rotation translation fx fy cx cy width height")
CameraGrads = namedtuple("CameraGrads", "d_rotation d_translation")
# Gaussians on the screen: u, v (2, N), a, b, c (3, N), their determinant, z and whether it is drawn (N,). 0 where not.
Projected = namedtuple("Projected", "mean2d covariance2d determinant depth visible")
ProjectionSaved = namedtuple("ProjectionSaved", "position shape camera settings visible")
ProjectionGrads = namedtuple("ProjectionGrads", "d_position d_rotation d_scale d_camera")


def jacobian(point, camera, settings):
    """J (2, 3, N) at points (3, N) in camera axes, its slopes x'/z, y'/z (2, N), and which slopes are unclamped."""
    x, y, z = point
    fx, fy = camera.fx, camera.fy
    # Ruling "off-axis clamp of J": slopes up to kappa tan(fov / 2), symmetric; kappa = 0 means no clamp.
    kappa = settings.jacobian_clamp
    sizes = np.array([[camera.width / fx], [camera.height / fy]])
    limit = kappa * sizes / 2 if kappa > 0 else np.inf * sizes
    slope = np.array([x / z, y / z])
    free = np.abs(np.real(slope)) <= limit
    slope = np.where(free, slope, np.copysign(limit, np.real(slope)))
    j = np.array([[fx / z, 0 * z, -fx * slope[0] / z], [0 * z, fy / z, -fy * slope[1] / z]])
    return j, slope, free


def projection_forward(position, shape, camera, settings):
    """Equation (B3): Projected of centres (3, N); cov = J W Sigma W^T J^T + low-pass, det = a c - b^2.

    a c - b^2 loses digits for a needle, which the kernel avoids by a sum of nonnegative terms. The kernel clips axes
    above 1e60 px (1e8 px in float32) and draws no Gaussian with |u| or |v| above it; here this limit is infinite.
    """
    point = camera.rotation @ position + camera.translation[:, None]
    visible = point[2].real > settings.near  # ruling "near plane"
    x, y, z = point = np.where(visible, point, 1)
    t = np.einsum("ijn,jk->ikn", jacobian(point, camera, settings)[0], camera.rotation)
    cov = np.einsum("ikn,kln,jln->ijn", t, covariance_matrix(shape), t)
    a, b, c = cov[0, 0] + settings.low_pass, cov[0, 1], cov[1, 1] + settings.low_pass
    values = np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, a, b, c, a * c - b * b, z])
    visible = visible & np.isfinite(values).all(axis=0)
    values = np.where(visible, values, 0)
    saved = ProjectionSaved(position, shape, camera, settings, visible)
    return Projected(values[:2], values[2:5], values[5], values[6], visible), saved


def projection_reverse(d_mean2d, d_covariance2d, d_depth, saved):
    """Reverse of (B3): b represents two entries. For needles, the kernel of the render starts from A, m, r."""
    position, shape, camera, settings, visible = saved
    d_mean2d, d_covariance2d, d_depth = (np.where(visible, g, 0) for g in (d_mean2d, d_covariance2d, d_depth))
    w = camera.rotation
    point = np.where(visible, w @ position + camera.translation[:, None], 1)
    j, slope, free = jacobian(point, camera, settings)
    g_sigma, g_t = covariance_reverse_parts(d_covariance2d, saved, point)
    g_m = 2 * np.einsum("ijn,jkn->ikn", g_sigma, shape.rotation * shape.scale)  # (6.1)
    d_scale = (shape.rotation * g_m).sum(axis=0)  # (6.2), (7.3)
    g_j = np.einsum("ikn,jk->ijn", g_t, w)
    g_point = point_reverse(point, slope, free, g_j, d_mean2d, d_depth, camera)
    d_w = g_point @ np.where(visible, position, 0).T + np.einsum("ijn,ikn->jk", j, g_t)  # (7.4), (7.11)
    return ProjectionGrads(w.T @ g_point, g_m * shape.scale, d_scale, CameraGrads(d_w, g_point.sum(axis=1)))  # (7.10)


def covariance_reverse_parts(d_covariance2d, saved, point):
    """dL/dSigma (3, 3, N) and dL/dT (2, 3, N), T = J W, from the gradient (3, N) of a, b, c."""
    t = np.einsum("ijn,jk->ikn", jacobian(point, saved.camera, saved.settings)[0], saved.camera.rotation)
    g_a, g_b, g_c = d_covariance2d
    g2 = np.array([[g_a, g_b / 2], [g_b / 2, g_c]])  # (7.1)
    g_sigma = np.einsum("ikn,ijn,jln->kln", t, g2, t)  # (7.2)
    g_t = 2 * np.einsum("ijn,jkn,kln->iln", g2, t, covariance_matrix(saved.shape))
    return g_sigma, g_t


def point_reverse(point, slope, free, g_j, d_mean2d, d_depth, camera):
    """dL/d(point in camera axes) (3, N), from the derivatives with respect to J, (u, v) and depth."""
    z = point[2]
    focal = np.array([[camera.fx], [camera.fy]])
    by_slope = np.array([g_j[0, 2], g_j[1, 2]])
    g_slope = -focal / z * by_slope  # J_02 = -f (x'/z) / z; (7.6)
    g_clipped = np.where(free, g_slope, 0)  # ruling: exact derivative of the clamp; (7.7)
    g_xy = (focal * d_mean2d + g_clipped) / z  # (7.8)
    by_scale = -focal / z**2 * (np.array([g_j[0, 0], g_j[1, 1]]) - slope * by_slope)  # (7.9)
    g_z = d_depth + (by_scale - g_xy * point[:2] / z).sum(axis=0)
    return np.concatenate([g_xy, [g_z]])
