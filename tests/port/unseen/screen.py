"""A Gaussian on the screen, for the independent port."""

import math

import numpy as np
from moving import Y00

# ---- a Gaussian on the screen ----


def covariance(i, s, k):
    q, log_scale = i["quaternion"], i["log_scale"]
    top = np.abs(q.real).max(0)
    safe = np.where(top == 0, 1, top)
    unit = q / safe
    norm = np.sqrt((unit**2).sum(0))
    unit = np.where(top == 0, np.array([[1.0], [0], [0], [0]]), unit / np.where(top == 0, 1, norm))
    if k("not normalised", False):
        unit = q
    w, x, y, z = unit[[3, 0, 1, 2]] if k("w last", False) else unit
    r = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    if k("rotation transposed", False):
        r = r.swapaxes(0, 1)
    limit = k("log-scale limit", 40)
    clipped = np.where(np.abs(log_scale.real) > limit, np.sign(log_scale.real) * limit, log_scale)
    return {"rotation": r, "scale": np.exp(k("log-scale times", 1) * clipped)}


def projected(i, s, k):
    camera, raster = s["camera"], s["raster"]
    w, d = i["rotation_matrix"], i["translation"]
    if k("camera to world", False):
        w, d = w.T, -w.T @ d
    p = w @ i["position"] + d[:, None]
    x, y, z = p
    seen = z.real > k("near", raster["near"])
    z = np.where(z.real == 0, 1, z)
    fx, fy = camera["fx"], k("fy", camera["fy"])
    fy = fx if k("one focal length", False) else fy
    mean = np.array([fx * x / z + camera["cx"], fy * y / z + camera["cy"]]) + k("pixel offset", 0)
    if k("centre of the image", False):
        mean = np.array([fx * x / z + camera["width"] / 2, fy * y / z + camera["height"] / 2])
    slope = []
    clamp = k("clamp", raster["jacobian_clamp"])
    for value, n, f in ((x, camera["width"], fx), (y, camera["height"], fy)):
        limit, t = clamp * n / (2 * f), value / z
        active = (np.abs(t.real) > limit) & bool(raster["jacobian_clamp"] or k("clamp", None))
        cut = z * np.where(active, np.sign(t.real) * limit, t)
        if raster["deviations"]["double_clamp_term"] != k("clamp deviates", False):
            cut = np.where(active, cut.real, cut)
        slope.append(cut)
    o = 0 * z
    zz = z.real if k("depth in J constant", False) else z
    j = np.array([[fx / zz, o, -fx * slope[0] / zz**2], [o, fy / zz, -fy * slope[1] / zz**2]])
    j = j.real + 0j if k("J constant", False) else j
    if k("J without depth", False):
        j[:, 2] = 0
    turned = w.T if k("W transposed in T", False) else w
    t = np.einsum("rjn,jk,kln->rln", j, turned, i["rotation"])
    m = t * i["scale"]
    low = k("low-pass", raster["low_pass"])
    a, b, c = (m[0] ** 2).sum(0) + low, (m[0] * m[1]).sum(0), (m[1] ** 2).sum(0) + k("low-pass of c", low)
    pairs = sum(
        (i["scale"][p] * i["scale"][q] * (t[0, p] * t[1, q] - t[1, p] * t[0, q])) ** 2
        for p, q in ((0, 1), (0, 2), (1, 2))
    )
    det = low**2 + low * (m**2).sum((0, 1)) + pairs
    if k("depth is distance", False):
        z = np.sqrt((p**2).sum(0))
    return mean, np.array([a, b, c]) * k("covariance times", 1), det, z, seen


def projection(i, s, k):
    mean, cover, _, z, seen = projected(i, s, k)
    keep = lambda a: np.where(seen, a, 0)
    return {"visible": seen, "mean2d": keep(mean), "covariance2d": keep(cover), "depth": keep(z)}


C = {
    "1": math.sqrt(3 / (4 * math.pi)),
    "2a": math.sqrt(15 / (4 * math.pi)),
    "2b": math.sqrt(5 / (16 * math.pi)),
    "2c": math.sqrt(15 / (16 * math.pi)),
    "3a": math.sqrt(35 / (32 * math.pi)),
    "3b": math.sqrt(105 / (4 * math.pi)),
    "3c": math.sqrt(21 / (32 * math.pi)),
    "3d": math.sqrt(7 / (16 * math.pi)),
    "3e": math.sqrt(105 / (16 * math.pi)),
}


def basis(n, count, k):
    x, y, z = n
    rows = [
        Y00 + 0 * x,
        -C["1"] * y,
        C["1"] * z,
        -C["1"] * x,
        C["2a"] * x * y,
        -C["2a"] * y * z,
        C["2b"] * (2 * z * z - x * x - y * y),
        -C["2a"] * x * z,
        C["2c"] * (x * x - y * y),
        -C["3a"] * y * (3 * x * x - y * y),
        C["3b"] * x * y * z,
        -C["3c"] * y * (4 * z * z - x * x - y * y),
        C["3d"] * z * (2 * z * z - 3 * x * x - 3 * y * y),
        -C["3c"] * x * (4 * z * z - x * x - y * y),
        C["3e"] * z * (x * x - y * y),
        -C["3a"] * x * (x * x - 3 * y * y),
    ]
    rows = [k("basis times", {}).get(j, 1) * row for j, row in enumerate(rows)]
    if k("basis order", None):
        rows = [rows[j] for j in k("basis order", None)]
    return np.array(rows[:count])


def harmonics(i, s, k):
    h, count = i["harmonics"], (s["degree"] + 1) ** 2
    v = i["position"] - i["centre"][:, None]
    if k("direction reversed", False):
        v = -v
    length = np.sqrt((v**2).sum(0))
    still = length.real == 0
    n = v / np.where(still, 1, length) if not k("direction not unit", False) else v
    if k("direction constant", False):
        n = n.real + 0j
    y = basis(n, count, k)
    y[1:] = np.where(still, 0, y[1:])
    stored = h[:count] + 0j
    stored[0] = stored[0] + k("residual times", 1) * i["residual"]
    colour = k("plus half", 0.5) + np.einsum("kn,kcn->cn", y, stored)
    low = k("colour floor", 0)
    colour = np.where(colour.real < low, low, colour)
    if k("colour clamp", False):
        colour = np.where(colour.real > 1, 1, colour)
    if k("blue first", False):
        colour = colour[::-1]
    return {"colour": colour}


def blended(mean, cover, det, z, seen, logit, colour, background, raster, width, height, k):
    deviation = raster["deviations"]
    if deviation["conic_epsilon"]:
        factor = det.real**2 / (det.real**2 + k("conic epsilon", 1e-7))
        cover = cover.real + 1j * cover.imag * factor
        det = det.real + 1j * det.imag * factor
    opacity = 1 / (1 + np.exp(-logit))
    x = np.arange(width) + k("sample", 0.5)
    y = (np.arange(height) + k("sample", 0.5))[:, None]
    left, live = np.ones((height, width), complex), np.ones((height, width), bool)
    image, depth, total = np.zeros((3, height, width), complex), 0 * left, 0 * left
    order = np.argsort(z.real, kind="stable")
    if k("index order", False):
        order = np.arange(len(z))
    if k("back to front", False):
        order = order[::-1]
    for n in order:
        if not seen[n]:
            continue
        a, b, c = cover[:, n]
        dx, dy = x - mean[0, n], y - mean[1, n]
        eta = dx - k("b times", 1) * b / c * dy
        q = dy * dy / c + c / det[n] * eta * eta
        raw = opacity[n] * np.exp(-q / k("exponent two", 2))
        top = k("alpha max", raster["alpha_max"])
        alpha = np.where(raw.real > top, top + 1j * raw.imag * deviation["pass_clamped_alpha"], raw)
        drawn = live & (alpha.real >= k("cutoff", raster["alpha_cutoff"]))
        if raster["support"] == "three_sigma_tiles":
            drawn &= tiles(mean[:, n].real, a.real, c.real, det[n].real, width, height, k)
        stop = k("stop", raster["transmittance_stop"])
        ends = drawn & ((left * (1 - alpha)).real < stop)
        if k("stop draws", False):
            live, weight = live & ~ends, np.where(drawn, alpha * left, 0)
        else:
            live, drawn = live & ~ends, drawn & ~ends
            weight = np.where(drawn, alpha * left, 0)
        depth_of = z[n].real if deviation["drop_depth_to_z"] or k("depth gradient dropped", False) else z[n]
        image, total = image + weight * colour[:, n, None, None], total + weight
        depth = depth + weight * depth_of
        left = np.where(drawn, left * (1 - alpha), left)
    if k("opacity from transmittance", False):
        total = 1 - left
    if k("depth normalised", False):
        depth = depth / np.where(total.real > 0, total, 1)
    if k("with background", True):
        image = image + (left if not k("background unweighted", False) else 1) * background[:, None, None]
    return {"colour_image": image, "depth_image": depth, "opacity_image": total}


def tiles(mean, a, c, det, width, height, k):
    half = (a + c) / 2
    radius = math.ceil(k("sigmas", 3) * math.sqrt(half + math.sqrt(max(k("root floor", 0.1), half**2 - det))))
    masks = []
    for centre, n in ((mean[0], width), (mean[1], height)):
        p = np.clip(centre - k("tile half", 0.5), -1e8, 1e8)
        first = math.trunc((p - radius) / 16)
        last = math.trunc((p + radius + 15) / 16)
        tile = np.arange(n) // k("tile", 16)
        masks.append((tile >= first) & (tile < last))
    return masks[1][:, None] & masks[0]


def composite(i, s, k):
    a, b, c = i["covariance2d"]
    det = a * c - b * b
    seen = np.ones(len(i["depth"]), bool)
    return blended(
        i["mean2d"],
        i["covariance2d"],
        det,
        i["depth"],
        seen,
        i["opacity_logit"],
        i["colour"],
        i["background"],
        s["raster"],
        s["width"],
        s["height"],
        k,
    )
