"""The residual of two frames of the port by hand: (B19)."""

import numpy as np


def keys(s):
    """Cubic convolution at a distance, and its derivative by the signed distance."""
    a, sign = np.abs(s), np.sign(s)
    near, far = a < 1, (a >= 1) & (a < 2)
    value = np.where(near, 1 - 2.5 * a**2 + 1.5 * a**3, np.where(far, 2 - 4 * a + 2.5 * a**2 - 0.5 * a**3, 0))
    slope = np.where(near, -5 * a + 4.5 * a**2, np.where(far, -4 + 5 * a - 1.5 * a**2, 0))
    return value, sign * slope


def registration(i, s):
    picture, camera = np.asarray(i["picture"], float), s["camera"]
    points = np.asarray(i["points"], float)
    w, shift = np.asarray(i["rotation"], float), np.asarray(i["translation"], float)
    big = w @ points + shift[:, None]
    height, width = picture.shape
    u = camera["fx"] * big[0] / big[2] + camera["cx"]
    v = camera["fy"] * big[1] / big[2] + camera["cy"]
    column, row = u - 0.5, v - 0.5
    seen = (big[2] > 0) & (column >= 1) & (column < width - 2) & (row >= 1) & (row < height - 2)
    k_u, slope_u = keys(column[:, None] - np.arange(width))
    k_v, slope_v = keys(row[:, None] - np.arange(height))
    value = np.einsum("mj,mi,ji->m", k_v, k_u, picture)
    i_u = np.einsum("mj,mi,ji->m", k_v, slope_u, picture)
    i_v = np.einsum("mj,mi,ji->m", slope_v, k_u, picture)
    g = np.array([camera["fx"] / big[2] * i_u, camera["fy"] / big[2] * i_v, np.zeros(len(u))])
    g[2] = -(camera["fx"] * big[0] * i_u + camera["fy"] * big[1] * i_v) / big[2] ** 2
    g = np.where(seen, g, 0) * i["d_residual"]
    return {
        "residual": np.where(seen, value - i["reference"], 0),
        "seen": seen,
        "d_rotation": g @ points.T,
        "d_translation": g.sum(axis=1),
        "d_points": w.T @ g,
        "d_reference": np.where(seen, -np.asarray(i["d_residual"], float), 0),
    }
