"""The rasteriser of the port by hand: (B2) to (B5) and the render, forward and reverse."""

import numpy as np
from hand_time import Y00

# ---- (B2) covariance ----


def unit_quaternion(raw):
    """The unit quaternion and the length; 1, 0, 0, 0 and no length for zero."""
    largest = np.abs(raw).max(0)
    zero = largest == 0
    scaled = raw / np.where(zero, 1, largest)
    size = np.sqrt((scaled**2).sum(0))
    unit = scaled / np.where(zero, 1, size)
    unit[0] = np.where(zero, 1, unit[0])
    return unit, np.where(zero, np.inf, size * largest)


def rotation_of(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def covariance_reverse(q, size, scale, log_scale, g, d_scale):
    w, x, y, z = q
    g_w = 2 * (x * (g[2, 1] - g[1, 2]) + y * (g[0, 2] - g[2, 0]) + z * (g[1, 0] - g[0, 1]))
    g_x = 2 * (
        -2 * x * (g[1, 1] + g[2, 2]) + y * (g[0, 1] + g[1, 0]) + z * (g[0, 2] + g[2, 0]) + w * (g[2, 1] - g[1, 2])
    )
    g_y = 2 * (
        x * (g[0, 1] + g[1, 0]) - 2 * y * (g[0, 0] + g[2, 2]) + z * (g[1, 2] + g[2, 1]) + w * (g[0, 2] - g[2, 0])
    )
    g_z = 2 * (
        x * (g[0, 2] + g[2, 0]) + y * (g[1, 2] + g[2, 1]) - 2 * z * (g[0, 0] + g[1, 1]) + w * (g[1, 0] - g[0, 1])
    )
    g_q = np.array([g_w, g_x, g_y, g_z])
    d_raw = (g_q - (q * g_q).sum(0) * q) / size
    inside = np.abs(log_scale) <= 40
    return d_raw, np.where(inside, scale * d_scale, 0)


def covariance(i, s):
    q, size = unit_quaternion(i["quaternion"])
    scale = np.exp(np.clip(i["log_scale"], -40, 40))
    d_q, d_s = covariance_reverse(q, size, scale, i["log_scale"], i["d_rotation"], i["d_scale"])
    return {"rotation": rotation_of(q), "scale": scale, "d_quaternion": d_q, "d_log_scale": d_s}


# ---- (B3) projection ----


def project(i, s):
    """Everything that the forward pass computes, by name."""
    camera, raster = s["camera"], s["raster"]
    w, d = i["rotation_matrix"], i["translation"]
    x, y, z = w @ i["position"] + d[:, None]
    visible = z > raster["near"]
    z = np.where(visible, z, 1)
    fx, fy = camera["fx"], camera["fy"]
    mean = np.array([fx * x / z + camera["cx"], fy * y / z + camera["cy"]])
    kappa = raster["jacobian_clamp"]
    limit_x = kappa * camera["width"] / (2 * fx) if kappa else np.inf
    limit_y = kappa * camera["height"] / (2 * fy) if kappa else np.inf
    x_cut = z * np.clip(x / z, -limit_x, limit_x)
    y_cut = z * np.clip(y / z, -limit_y, limit_y)
    o = 0 * z
    j = np.array([[fx / z, o, -fx * x_cut / z**2], [o, fy / z, -fy * y_cut / z**2]])
    wr = np.einsum("jk,kln->jln", w, i["rotation"])
    t = np.einsum("rjn,jln->rln", j, wr)
    m = t * i["scale"]
    eps = raster["low_pass"]
    a = (m[0] ** 2).sum(0) + eps
    b = (m[0] * m[1]).sum(0)
    c = (m[1] ** 2).sum(0) + eps
    det = eps**2 + eps * (m**2).sum((0, 1))
    for k, n in ((0, 1), (0, 2), (1, 2)):
        det = det + (i["scale"][k] * i["scale"][n] * (t[0, k] * t[1, n] - t[1, k] * t[0, n])) ** 2
    return {
        "view": (x, y, z), "visible": visible, "mean": mean, "cut": (x_cut, y_cut), "jacobian": j,
        "active": (np.abs(x / z) > limit_x, np.abs(y / z) > limit_y),
        "wr": wr, "t": t, "m": m, "cov": np.array([a, b, c]), "det": det,
    }  # fmt: skip


def shape_reverse(p, scale, g_cov):
    """g_S and g_T from the gradient by a, b, c."""
    g_a, g_b, g_c = g_cov
    g_m = 2 * np.array([g_a * p["m"][0] + g_b / 2 * p["m"][1], g_b / 2 * p["m"][0] + g_c * p["m"][1]])
    return (p["t"] * g_m).sum(0), g_m * scale


def needle_reverse(p, scale, eps, g_foot):
    """g_S and g_T from the gradient by A, m, r, without cancellation."""
    g_big, g_m, g_r = g_foot
    t0, t1 = p["t"]
    m, r, big = p["cov"][1] / p["cov"][2], 1 / p["cov"][2], p["cov"][2] / p["det"]
    g_s, g_t = np.zeros(t0.shape), np.zeros(p["t"].shape)
    for k in range(3):
        mixed = sum(scale[n] ** 2 * t1[n] * (t0[k] * t1[n] - t1[k] * t0[n]) for n in range(3) if n != k)
        e = r * (eps * t0[k] + mixed)
        g_s[k] = -2 * scale[k] * (big**2 * g_big * e**2 - r * g_m * t1[k] * e + r**2 * g_r * t1[k] ** 2)
        g_t[0, k] = scale[k] ** 2 * (r * g_m * t1[k] - 2 * big**2 * g_big * e)
        g_t[1, k] = scale[k] ** 2 * (2 * big**2 * m * g_big * e + r * g_m * (e - m * t1[k]) - 2 * r**2 * g_r * t1[k])
    return g_s, g_t


def point_reverse(p, i, s, g_mean, g_depth, g_t):
    """g_R and the gradients by position, W and d."""
    fx, fy = s["camera"]["fx"], s["camera"]["fy"]
    w, j, wr = i["rotation_matrix"], p["jacobian"], p["wr"]
    x, y, z = p["view"]
    x_cut, y_cut = p["cut"]
    beyond_x, beyond_y = p["active"]
    g_j = np.einsum("rln,jln->rjn", g_t, wr)
    jw = np.einsum("rjn,jk->rkn", j, w)
    g_rotation = np.einsum("rkn,rln->kln", jw, g_t)
    g_cut_x = -fx / z**2 * g_j[0, 2]
    g_cut_y = -fy / z**2 * g_j[1, 2]
    g_u, g_v = g_mean
    g_x = fx / z * g_u + np.where(beyond_x, 0, g_cut_x)
    g_y = fy / z * g_v + np.where(beyond_y, 0, g_cut_y)
    g_z = g_depth - (fx * x * g_u + fy * y * g_v) / z**2
    g_z = g_z - fx / z**2 * g_j[0, 0] - fy / z**2 * g_j[1, 1]
    g_z = g_z + 2 * fx * x_cut / z**3 * g_j[0, 2] + 2 * fy * y_cut / z**3 * g_j[1, 2]
    if not s["raster"]["deviations"]["double_clamp_term"]:
        g_z = g_z + np.where(beyond_x, x_cut / z * g_cut_x, 0) + np.where(beyond_y, y_cut / z * g_cut_y, 0)
    g_view = np.where(p["visible"], np.array([g_x, g_y, g_z]), 0)
    g_t = np.where(p["visible"], g_t, 0)
    g_w = g_view @ i["position"].T + np.einsum("rjn,rln,kln->jk", j, g_t, i["rotation"])
    return np.where(p["visible"], g_rotation, 0), w.T @ g_view, g_w, g_view.sum(1)


def projection(i, s):
    p = project(i, s)
    g_s, g_t = shape_reverse(p, i["scale"], i["d_covariance2d"])
    g_r, g_position, g_w, g_d = point_reverse(p, i, s, i["d_mean2d"], i["d_depth"], g_t)
    shown = p["visible"]
    return {
        "visible": shown,
        "mean2d": np.where(shown, p["mean"], 0),
        "covariance2d": np.where(shown, p["cov"], 0),
        "depth": np.where(shown, p["view"][2], 0),
        "d_position": g_position,
        "d_rotation": g_r,
        "d_scale": np.where(shown, g_s, 0),
        "d_rotation_matrix": g_w,
        "d_translation": g_d,
    }


# ---- (B4) harmonics ----

K1 = np.sqrt(3 / (4 * np.pi))
K2A, K2B, K2C = np.sqrt(15 / (4 * np.pi)), np.sqrt(5 / (16 * np.pi)), np.sqrt(15 / (16 * np.pi))
K3A, K3B, K3C = np.sqrt(35 / (32 * np.pi)), np.sqrt(105 / (4 * np.pi)), np.sqrt(21 / (32 * np.pi))
K3D, K3E = np.sqrt(7 / (16 * np.pi)), np.sqrt(105 / (16 * np.pi))


def basis(n):
    """Y_k and its slopes by x, y, z as if these were independent."""
    x, y, z = n
    o, xx, yy, zz = 0 * x, x * x, y * y, z * z
    table = [
        (Y00 + o, o, o, o),
        (-K1 * y, o, -K1 + o, o),
        (K1 * z, o, o, K1 + o),
        (-K1 * x, -K1 + o, o, o),
        (K2A * x * y, K2A * y, K2A * x, o),
        (-K2A * y * z, o, -K2A * z, -K2A * y),
        (K2B * (2 * zz - xx - yy), -2 * K2B * x, -2 * K2B * y, 4 * K2B * z),
        (-K2A * x * z, -K2A * z, o, -K2A * x),
        (K2C * (xx - yy), 2 * K2C * x, -2 * K2C * y, o),
        (-K3A * y * (3 * xx - yy), -6 * K3A * x * y, -K3A * (3 * xx - 3 * yy), o),
        (K3B * x * y * z, K3B * y * z, K3B * x * z, K3B * x * y),
        (-K3C * y * (4 * zz - xx - yy), 2 * K3C * x * y, -K3C * (4 * zz - xx - 3 * yy), -8 * K3C * y * z),
        (K3D * z * (2 * zz - 3 * xx - 3 * yy), -6 * K3D * x * z, -6 * K3D * y * z, K3D * (6 * zz - 3 * xx - 3 * yy)),
        (-K3C * x * (4 * zz - xx - yy), -K3C * (4 * zz - 3 * xx - yy), 2 * K3C * x * y, -8 * K3C * x * z),
        (K3E * z * (xx - yy), 2 * K3E * x * z, -2 * K3E * y * z, K3E * (xx - yy)),
        (-K3A * x * (xx - 3 * yy), -K3A * (3 * xx - 3 * yy), 6 * K3A * x * y, o),
    ]
    return np.array([row[0] for row in table]), np.array([row[1:] for row in table])


def harmonics(i, s):
    h, count = i["harmonics"], (s["degree"] + 1) ** 2
    v = i["position"] - i["centre"][:, None]
    length = np.sqrt((v**2).sum(0))
    still = length == 0
    n = np.where(still, 0, v / np.where(still, 1, length))
    y, slopes = basis(n)
    y, slopes = y[:count], slopes[:count]
    y[1:] = np.where(still, 0, y[1:])
    stored = h[:count].copy()
    stored[0] = stored[0] + i["residual"]
    before = 0.5 + np.einsum("kn,kcn->cn", y, stored)
    g = np.where(before >= 0, i["d_colour"], 0)
    d_h = np.zeros(h.shape)
    d_h[:count] = y[:, None] * g
    g_n = np.einsum("cn,kcn,kan->an", g, stored[1:], slopes[1:])
    g_v = np.where(still, 0, (g_n - (n * g_n).sum(0) * n) / np.where(still, 1, length))
    return {
        "colour": np.maximum(before, 0),
        "d_harmonics": d_h,
        "d_residual": d_h[0],
        "d_position": g_v,
        "d_centre": -g_v.sum(1),
    }


# ---- (B5) composite ----


def tile_support(mean, a, c, det, height, width):
    """Pixels of the tiles of 16 x 16 that a radius of three sigma touches."""
    half = (a + c) / 2
    radius = np.ceil(3 * np.sqrt(half + np.sqrt(max(0.1, half**2 - det))))
    inside = []
    for centre, n in ((mean[1], height), (mean[0], width)):
        p = centre - 0.5
        first, last = np.trunc((p - radius) / 16), np.trunc((p + radius + 15) / 16)
        tile = np.arange(n) // 16
        inside.append((tile >= first) & (tile < last))
    return inside[0][:, None] & inside[1]


def blend(mean, cov, det, depth, visible, logit, colour, background, raster, height, width):
    """Images, and what the reverse pass needs of each Gaussian, front to back."""
    opacity = 1 / (1 + np.exp(-logit))
    columns, rows = np.arange(width) + 0.5, (np.arange(height) + 0.5)[:, None]
    left, open_ = np.ones((height, width)), np.ones((height, width), bool)
    image, far, sum_ = np.zeros((3, height, width)), np.zeros((height, width)), np.zeros((height, width))
    layers = []
    for n in np.argsort(depth, kind="stable"):
        if not visible[n]:
            continue
        a, b, c = cov[:, n]
        dx, dy = columns - mean[0, n], rows - mean[1, n]
        eta = dx - b / c * dy
        raw = opacity[n] * np.exp(-(dy**2 / c + c / det[n] * eta**2) / 2)
        alpha = np.minimum(raw, raster["alpha_max"])
        drawn = open_ & (alpha >= raster["alpha_cutoff"])
        if raster["support"] == "three_sigma_tiles":
            drawn &= tile_support(mean[:, n], a, c, det[n], height, width)
        ends = drawn & (left * (1 - alpha) < raster["transmittance_stop"])
        open_ &= ~ends
        alpha = np.where(drawn & ~ends, alpha, 0)
        weight = alpha * left
        image += weight * colour[:, n, None, None]
        far += weight * depth[n]
        sum_ += weight
        layers.append((n, alpha, raw, left, dy, eta))
        left = left * (1 - alpha)
    image += left * background[:, None, None]
    return image, far, sum_, left, layers


def blend_reverse(layers, left, cov, det, depth, logit, colour, background, raster, g_image, g_far, g_sum):
    """Gradients by mean, footprint A, m, r, logit, colour, depth and background."""
    deviation = raster["deviations"]
    opacity = 1 / (1 + np.exp(-logit))
    count = len(logit)
    g_mean, g_foot, g_colour = np.zeros((2, count)), np.zeros((3, count)), np.zeros((3, count))
    g_logit, g_depth = np.zeros(count), np.zeros(count)
    behind = background[:, None, None] + 0 * g_image
    z_behind, o_behind = 0 * g_far, 0 * g_sum
    for n, alpha, raw, before, dy, eta in layers[::-1]:
        rgb = colour[:, n, None, None]
        g_alpha = ((rgb - behind) * g_image).sum(0)
        g_alpha = g_alpha + (depth[n] - z_behind) * g_far
        g_alpha = g_alpha + (1 - o_behind) * g_sum
        g_alpha = before * g_alpha
        g_colour[:, n] = (alpha * before * g_image).sum((1, 2))
        if not deviation["drop_depth_to_z"]:
            g_depth[n] = (alpha * before * g_far).sum()
        behind = alpha * rgb + (1 - alpha) * behind
        z_behind = alpha * depth[n] + (1 - alpha) * z_behind
        o_behind = alpha + (1 - alpha) * o_behind
        passes = (alpha > 0) & (raw <= raster["alpha_max"])
        used = np.where(passes, alpha, 0)
        if deviation["pass_clamped_alpha"]:
            used = np.where(alpha > 0, raw, 0)
        g_logit[n] = (used * (1 - opacity[n]) * g_alpha).sum()
        g_q = -used * g_alpha / 2
        m, r, big = cov[1, n] / cov[2, n], 1 / cov[2, n], cov[2, n] / det[n]
        g_foot[0, n] = (eta**2 * g_q).sum()
        g_foot[1, n] = (-2 * big * eta * dy * g_q).sum()
        g_foot[2, n] = (dy**2 * g_q).sum()
        g_mean[0, n] = (-2 * big * eta * g_q).sum()
        g_mean[1, n] = (-2 * (r * dy - big * m * eta) * g_q).sum()
    if deviation["conic_epsilon"]:
        g_foot = g_foot * det**2 / (det**2 + 1e-7)
    return g_mean, g_foot, g_logit, g_colour, g_depth, (left * g_image).sum((1, 2))


def covariance_gradient(cov, det, g_foot):
    g_big, g_m, g_r = g_foot
    m, r, big = cov[1] / cov[2], 1 / cov[2], cov[2] / det
    g_a = -(big**2) * g_big
    g_b = 2 * big**2 * m * g_big + r * g_m
    g_c = -(big**2) * m**2 * g_big - m * r * g_m - r**2 * g_r
    return np.array([g_a, g_b, g_c])


def composite(i, s):
    a, b, c = cov = i["covariance2d"]
    det = a * c - b**2
    logit, raster, background = i["opacity_logit"], s["raster"], i["background"]
    shown = np.ones(len(logit), bool)
    image, far, sum_, left, layers = blend(
        i["mean2d"], cov, det, i["depth"], shown, logit, i["colour"], background, raster, s["height"], s["width"]
    )
    given = i["d_colour_image"], i["d_depth_image"], i["d_opacity_image"]
    g_mean, g_foot, g_logit, g_colour, g_depth, g_background = blend_reverse(
        layers, left, cov, det, i["depth"], logit, i["colour"], background, raster, *given
    )
    return {
        "colour_image": image,
        "depth_image": far,
        "opacity_image": sum_,
        "d_mean2d": g_mean,
        "d_covariance2d": covariance_gradient(cov, det, g_foot),
        "d_opacity_logit": g_logit,
        "d_colour": g_colour,
        "d_depth": g_depth,
        "d_background": g_background,
    }


# ---- render ----


def render(i, s):
    camera, raster, w, d = s["camera"], s["raster"], i["rotation_matrix"], i["translation"]
    q, size = unit_quaternion(i["quaternion"])
    scale = np.exp(np.clip(i["log_scale"], -40, 40))
    shape = i | {"rotation": rotation_of(q), "scale": scale}
    p = project(shape, s)
    cov, det, shown, depth = p["cov"], p["det"], p["visible"], p["view"][2]
    residual = i.get("residual", np.zeros((3, len(depth))))
    lit = {"harmonics": i["harmonics"], "residual": residual, "position": i["position"], "centre": -w.T @ d}
    colour = harmonics(lit | {"d_colour": np.zeros((3, len(depth)))}, s)["colour"]
    logit, background = i["opacity_logit"], i["background"]
    image, far, sum_, left, layers = blend(
        p["mean"], cov, det, depth, shown, logit, colour, background, raster, camera["height"], camera["width"]
    )
    given = i["d_colour_image"], i["d_depth_image"], i["d_opacity_image"]
    g_mean, g_foot, g_logit, g_colour, g_depth, g_background = blend_reverse(
        layers, left, cov, det, depth, logit, colour, background, raster, *given
    )
    g_s, g_t = needle_reverse(p, scale, raster["low_pass"], g_foot)
    g_rotation, g_position, g_w, g_d = point_reverse(p, shape, s, g_mean, g_depth, g_t)
    back = harmonics(lit | {"d_colour": g_colour}, s)
    g_centre = back["d_centre"]
    d_q, d_log = covariance_reverse(q, size, scale, i["log_scale"], g_rotation, np.where(shown, g_s, 0))
    return {
        "colour_image": image,
        "depth_image": far,
        "opacity_image": sum_,
        "visible": in_the_box(p, logit, raster, camera),
        "d_position": g_position + back["d_position"],
        "d_quaternion": d_q,
        "d_log_scale": d_log,
        "d_opacity_logit": g_logit,
        "d_harmonics": back["d_harmonics"],
        "d_residual": back["d_residual"],
        "d_mean2d": g_mean,
        "d_background": g_background,
        "d_rotation_matrix": g_w - np.outer(d, g_centre),
        "d_translation": g_d - w @ g_centre,
    }


def in_the_box(p, logit, raster, camera):
    """Whether the box of the ellipse holds a pixel centre."""
    reach = np.sqrt(2 * np.log(1 / (1 + np.exp(-logit)) / raster["alpha_cutoff"]))
    visible = p["visible"] & np.isfinite(reach)
    for centre, variance, n in (
        (p["mean"][0], p["cov"][0], camera["width"]),
        (p["mean"][1], p["cov"][2], camera["height"]),
    ):
        half = reach * np.sqrt(variance)
        first, last = np.ceil(centre - half - 0.5), np.floor(centre + half - 0.5)
        visible = visible & (np.minimum(last, n - 1) >= np.maximum(first, 0))
    return visible
