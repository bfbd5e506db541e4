"""Oracle of the rasteriser (B2-B5): NumPy straight from the formulas, one Gaussian at a time over whole images.

Every function also takes complex arrays: decisions look at the real part, nothing is conjugated, so
Im f(x + i h v) / h is the directional derivative of the branch taken, to rounding (complex step).
Sigma is formed, the Mahalanobis form uses the inverse matrix: other formulas than those of the package.
"""

import mpmath
import numpy as np

C0, C1 = np.sqrt(1 / (4 * np.pi)), np.sqrt(3 / (4 * np.pi))
C2A, C2B, C2C = np.sqrt(15 / (4 * np.pi)), np.sqrt(5 / (16 * np.pi)), np.sqrt(15 / (16 * np.pi))
C3A, C3B, C3C = np.sqrt(35 / (32 * np.pi)), np.sqrt(105 / (4 * np.pi)), np.sqrt(21 / (32 * np.pi))
C3D, C3E = np.sqrt(7 / (16 * np.pi)), np.sqrt(105 / (16 * np.pi))


def rotation(quaternion):
    """(3, 3, N) from raw (4, N) w, x, y, z: the image of the unit vectors under v -> q v q*."""
    w, x, y, z = quaternion / np.sqrt((quaternion**2).sum(axis=0))
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def covariance(quaternion, log_scale):
    """(3, 3, N) Sigma = R diag(exp(2 s)) R^T."""
    r = rotation(quaternion)
    return np.einsum("ikn,kn,jkn->ijn", r, np.exp(2 * log_scale), r)


def clip_slope(slope, limit):
    """clip(slope, -limit, limit), constant where it is clipped."""
    return np.where(np.abs(slope.real) <= limit, slope, np.copysign(limit, slope.real))


def project(position, sigma, pose, lens, rules):
    """u, v, a, b, c, z of N Gaussians; pose = (W, d), lens = (fx, fy, cx, cy, width, height)."""
    (w, d), (fx, fy, cx, cy, width, height) = pose, lens
    x, y, z = w @ position + d[:, None]
    kappa = rules["jacobian_clamp"]
    limit_x = kappa * width / (2 * fx) if kappa > 0 else np.inf
    limit_y = kappa * height / (2 * fy) if kappa > 0 else np.inf
    zero = np.zeros_like(z)
    j = np.array(
        [
            [fx / z, zero, -fx * clip_slope(x / z, limit_x) / z],
            [zero, fy / z, -fy * clip_slope(y / z, limit_y) / z],
        ]
    )
    t = np.einsum("ikn,kl->iln", j, w)
    cov = np.einsum("ikn,kln,jln->ijn", t, sigma, t)
    return fx * x / z + cx, fy * y / z + cy, cov[0, 0] + rules["low_pass"], cov[0, 1], cov[1, 1] + rules["low_pass"], z


def determinant(position, rotation_matrix, scale, pose, lens, low_pass, digits=60):
    """One Gaussian, no clamp: a c - b^2, and a, b, c with it, in `digits` decimal digits (mpmath)."""
    with mpmath.workdps(digits):
        (w, d), (fx, fy, _, _, _, _) = pose, lens
        w, r = mpmath.matrix(w.tolist()), mpmath.matrix(rotation_matrix.tolist())
        seen = w * mpmath.matrix(position.tolist()) + mpmath.matrix(d.tolist())
        x, y, z = seen[0], seen[1], seen[2]
        fx, fy = mpmath.mpf(float(fx)), mpmath.mpf(float(fy))
        j = mpmath.matrix([[fx / z, 0, -fx * x / z**2], [0, fy / z, -fy * y / z**2]])
        m = j * w * r * mpmath.diag([mpmath.mpf(float(s)) for s in scale])
        cov = m * m.T
        a, b, c = cov[0, 0] + mpmath.mpf(float(low_pass)), cov[0, 1], cov[1, 1] + mpmath.mpf(float(low_pass))
        return a * c - b * b, a, b, c


def basis(direction):
    """(16, N) real harmonics of unit directions (3, N)."""
    x, y, z = direction
    one = np.ones_like(x)
    return np.array(
        [
            C0 * one,
            -C1 * y,
            C1 * z,
            -C1 * x,
            C2A * x * y,
            -C2A * y * z,
            C2B * (2 * z**2 - x**2 - y**2),
            -C2A * x * z,
            C2C * (x**2 - y**2),
            -C3A * y * (3 * x**2 - y**2),
            C3B * x * y * z,
            -C3C * y * (4 * z**2 - x**2 - y**2),
            C3D * z * (2 * z**2 - 3 * x**2 - 3 * y**2),
            -C3C * x * (4 * z**2 - x**2 - y**2),
            C3E * z * (x**2 - y**2),
            -C3A * x * (x**2 - 3 * y**2),
        ]
    )


def colour(harmonics, residual, position, centre, degree):
    """(3, N) display colour."""
    v = position - centre[:, None]
    y = basis(v / np.sqrt((v**2).sum(axis=0)))[: (degree + 1) ** 2]
    out = 0.5 + np.einsum("kn,kcn->cn", y, harmonics[: (degree + 1) ** 2])
    if residual is not None:
        out = out + C0 * residual
    return np.where(out.real >= 0, out, 0)


def reached(u, v, a, b, c, width, height, support):
    """(H, W) bool: which pixels the support rule lets a Gaussian reach (`ellipse` is implied by the cutoff)."""
    mask = np.ones((height, width), bool)
    if support != "three_sigma_tiles":
        return mask
    half = (a + c) / 2
    radius = np.ceil(3 * np.sqrt(half + np.sqrt(max(0.1, half * half - (a * c - b * b)))))
    for axis, (p, pixels) in enumerate(((v - 0.5, height), (u - 0.5, width))):
        tiles = -(-pixels // 16)
        first = min(max(int((p - radius) / 16), 0), tiles)
        last = min(max(int((p + radius + 15) / 16), 0), tiles)
        index = np.arange(pixels) // 16
        inside = (index >= first) & (index < last)
        mask &= inside[:, None] if axis == 0 else inside[None, :]
    return mask


def layers(u, v, a, b, c, z, opacity, seen, width, height, rules):
    """Front to back: (index, dx, dy, unclamped alpha, alpha, T in front, taken); `taken` = pixels it is blended in."""
    x, y = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    kind = np.result_type(u, v, a, b, c, opacity)
    t, live = np.ones((height, width), kind), np.ones((height, width), bool)
    out = []
    for i in np.argsort(z.real, kind="stable"):
        if not seen[i]:
            continue
        dx, dy = x - u[i], y - v[i]
        det = a[i] * c[i] - b[i] * b[i]
        value = opacity[i] * np.exp(-0.5 * (c[i] * dx * dx - 2 * b[i] * dx * dy + a[i] * dy * dy) / det)
        alpha = np.where(value.real <= rules["alpha_max"], value, rules["alpha_max"])
        wanted = live & (alpha.real >= rules["alpha_cutoff"])
        wanted &= reached(u[i].real, v[i].real, a[i].real, b[i].real, c[i].real, width, height, rules["support"])
        live &= ~(wanted & ((t * (1 - alpha)).real < rules["transmittance_stop"]))
        taken = wanted & live
        out.append((i, dx + 0 * dy, dy + 0 * dx, value, alpha, t, taken))
        t = np.where(taken, t * (1 - alpha), t)
    return out, t


def composite(u, v, a, b, c, z, opacity, seen, rgb, background, width, height, rules):
    """colour (3, H, W), depth, opacity, final T."""
    stack, t = layers(u, v, a, b, c, z, opacity, seen, width, height, rules)
    colour_image = t * background[:, None, None]
    depth = opacity_image = np.zeros_like(t)
    for i, _, _, _, alpha, front, taken in stack:
        weight = np.where(taken, alpha * front, 0)
        colour_image = colour_image + weight * rgb[:, i, None, None]
        depth = depth + weight * z[i]
        opacity_image = opacity_image + weight
    return colour_image, depth, opacity_image, t


def composite_reverse(
    d_colour, d_depth, d_opacity, u, v, a, b, c, z, opacity, seen, rgb, background, width, height, rules, pass_clamped
):
    """Gradients by u, v, (a, b, c), logit, rgb, z and background: R_k recursion, then matrix calculus."""
    stack, t_end = layers(u, v, a, b, c, z, opacity, seen, width, height, rules)
    n = u.size
    out = {
        "mean2d": np.zeros((2, n)), "covariance2d": np.zeros((3, n)), "opacity_logit": np.zeros(n),
        "colour": np.zeros((3, n)), "depth": np.zeros(n), "background": (d_colour * t_end).sum(axis=(1, 2)),
    }  # fmt: skip
    r = np.broadcast_to(background[:, None, None], d_colour.shape)
    rz, ro = np.zeros_like(t_end), np.zeros_like(t_end)
    for i, dx, dy, value, alpha, front, taken in reversed(stack):
        c_i = rgb[:, i, None, None]
        g = front * (((c_i - r) * d_colour).sum(axis=0) + (z[i] - rz) * d_depth + (1 - ro) * d_opacity)
        passes = taken & ((value <= rules["alpha_max"]) | pass_clamped)
        power = np.where(passes, value * g, 0.0)  # dL / d(-q/2)
        q = np.linalg.inv([[a[i], b[i]], [b[i], c[i]]])
        px, py = q[0, 0] * dx + q[0, 1] * dy, q[0, 1] * dx + q[1, 1] * dy  # Q d
        out["mean2d"][:, i] = (power * px).sum(), (power * py).sum()
        # d(-q/2)/dSigma = Q d d^T Q / 2; the off-diagonal scalar b stands for two entries
        out["covariance2d"][:, i] = 0.5 * (power * px**2).sum(), (power * px * py).sum(), 0.5 * (power * py**2).sum()
        out["opacity_logit"][i] = (power * (1 - opacity[i])).sum()
        weight = np.where(taken, alpha * front, 0.0)
        out["colour"][:, i] = (weight * d_colour).sum(axis=(1, 2))
        out["depth"][i] = (weight * d_depth).sum()
        r = np.where(taken, alpha * c_i + (1 - alpha) * r, r)
        rz = np.where(taken, alpha * z[i] + (1 - alpha) * rz, rz)
        ro = np.where(taken, alpha + (1 - alpha) * ro, ro)
    return out


def sigmoid(logit):
    """1 / (1 + exp(-x)), complex allowed, without overflow."""
    e = np.exp(np.where(logit.real < 0, logit, -logit))
    return np.where(logit.real < 0, e / (1 + e), 1 / (1 + e))


def render(scene, pose, lens, rules, background, degree=3):
    """colour, depth, opacity, final T; scene: dict with the names of the package, `residual` may be None or missing."""
    sigma = covariance(scene["quaternion"], scene["log_scale"])
    z = (pose[0] @ scene["position"] + pose[1][:, None])[2]
    seen = z.real > rules["near"]
    front = np.where(seen, 0.0, 1.0 - z.real)  # those behind are moved to z = 1 and not drawn
    shifted = (pose[0], pose[1])
    position = scene["position"] + np.linalg.inv(pose[0].real)[:, 2:3] * front
    u, v, a, b, c, z = project(position, sigma, shifted, lens, rules)
    centre = -pose[0].T @ pose[1]
    rgb = colour(scene["harmonics"], scene.get("residual"), scene["position"], centre, degree)
    width, height = lens[4:]
    return composite(
        u, v, a, b, c, z, sigmoid(scene["opacity_logit"]), seen, rgb, background, width, height, rules
    )  # fmt: skip
