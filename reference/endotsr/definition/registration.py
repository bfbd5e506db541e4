"""Equation (B19): the residual of one frame registered on another by depth and a relative pose."""

from collections import namedtuple

import numpy as np

RegistrationSaved = namedtuple("RegistrationSaved", "rotation points slope seen")
RegistrationGrads = namedtuple("RegistrationGrads", "d_rotation d_translation d_points d_reference")


def keys(s):
    """Keys' kernel k(s) with a = -1/2, and its slope k'(s)."""
    r, sign = np.abs(s), np.sign(s)
    inner, outer = 1 - 2.5 * r**2 + 1.5 * r**3, 2 - 4 * r + 2.5 * r**2 - 0.5 * r**3  # (22.1)
    slopes = -5 * r + 4.5 * r**2, -4 + 5 * r - 1.5 * r**2  # (22.2)
    return np.where(r < 1, inner, np.where(r < 2, outer, 0)), sign * np.where(r < 1, slopes[0], (r < 2) * slopes[1])


def registration_forward(rotation, translation, points, reference, picture, camera):
    """Equation (B19): residuals (M,) = I(pi(W x + d)) - reference of points (3, M); 0 for a point out of view.

    The points are finite. The picture is (H, W); of the camera, the intrinsics alone are read.
    """
    x, y, z = rotation @ points + translation[:, None]
    safe, (height, width) = np.where(z > 0, z, 1), picture.shape
    u, v = camera.fx * x / safe + camera.cx - 0.5, camera.fy * y / safe + camera.cy - 0.5
    seen = (z > 0) & (u >= 1) & (u < width - 2) & (v >= 1) & (v < height - 2)
    across, across_slope = keys(np.where(seen, u, 1)[:, None] - np.arange(width))
    down, down_slope = keys(np.where(seen, v, 1)[:, None] - np.arange(height))
    value, slope_u, slope_v = (
        np.einsum("mj,ji,mi->m", b, picture, a) for b, a in ((down, across), (down, across_slope), (down_slope, across))
    )
    slope = np.array([slope_u * camera.fx / safe, slope_v * camera.fy / safe])
    slope = np.where(seen, [*slope, -(slope * [x, y]).sum(axis=0) / safe], 0)  # (22.3)
    return np.where(seen, value - reference, 0), RegistrationSaved(rotation, points, slope, seen)


def registration_reverse(d_residual, saved):
    """Reverse of (B19)."""
    g = saved.slope * d_residual  # (22.4)
    return RegistrationGrads(g @ saved.points.T, g.sum(axis=1), saved.rotation.T @ g, -d_residual * saved.seen)
