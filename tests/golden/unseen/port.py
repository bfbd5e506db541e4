"""A port in NumPy written from docs/specification alone, whose every choice can be replaced by a wrong one.

`port(operation, inputs, settings, wrong)` gives the outputs of a golden case. `wrong` holds the replaced choices by
name; what it does not hold is right. Only forward formulas are written. A gradient is a complex step of the forward
formula: the imaginary part after a step of 1e-50 along the imaginary axis is the derivative to the last digit. So a
wrong choice in a formula reaches value and gradient together, and `wrong["forward"]` and `wrong["reverse"]` restrict
it to one of them.
"""

import math

import numpy as np

STEP = 1e-50
Y00 = 1 / math.sqrt(4 * math.pi)


class Choices:
    """The choices of a port: `k("name", right)` is the right one, unless it is replaced."""

    def __init__(self, wrong):
        self.wrong, self.asked = wrong, set()

    def __call__(self, name, right):
        self.asked.add(name)
        return self.wrong.get(name, right)


def size(x):
    """|x| along the complex step; the derivative at 0 is 0."""
    return x * np.sign(x.real)


def select(mask, image, k):
    """The image where the mask is True and 0 elsewhere, by selection."""
    if k("multiply mask", False):
        return image * mask
    return np.where(mask, image, 0)


# ---- time ----


def frequencies(i, s, k):
    n, low, high = s["count"], s["low"], s["high"]
    if n == 1:
        return {"omega": np.array([high if k("one frequency is the highest", False) else low])}
    if k("linear frequencies", False):
        return {"omega": np.linspace(low, high, n)}
    power = np.arange(n) / k("frequency steps", lambda n: n - 1)(n)
    return {"omega": low * (high / low) ** power}


def waves(t, omega, k):
    turns = k("turn", 2 * math.pi) / (2 * math.pi) * omega * t
    sine, cosine = np.split(exact_waves(turns), 2)
    if k("cosine sign", 1) < 0:
        cosine = -cosine
    if k("interleaved", False):
        return np.stack([sine, cosine], 1).ravel()
    return np.concatenate([cosine, sine] if k("cosines first", False) else [sine, cosine])


def dictionary(i, s, k):
    return {"phi": waves(i["t"], i["omega"], k)}


def statistics(times, omega, k):
    times = times if k("stamps counted twice", False) else np.unique(times)
    phi = np.array([exact_waves(omega * t) for t in times.real])
    mean = phi.mean(0)
    spread = ((phi - k("centred", 1) * mean) ** 2).sum(0) / max(len(times) - k("degrees of freedom", 0), 1)
    rms = np.sqrt(spread)
    if k("population deviation", False):
        rms = np.abs(phi - mean).mean(0)
    return mean, rms, rms < k("dead below", 1e-6)


def exact_waves(turns):
    """Sines and cosines of whole turns, which are removed first."""
    turns = turns - np.round(turns.real)
    quarter = np.round(4 * turns.real)
    rest = 2 * math.pi * (turns - quarter / 4)
    sine, cosine = np.sin(rest), np.cos(rest)
    q = quarter.astype(int) % 4
    return np.concatenate([np.choose(q, [sine, cosine, -sine, -cosine]), np.choose(q, [cosine, -sine, -cosine, sine])])


def atoms(i, s, k):
    stamps = i["times"] if k("all stamps", False) else i["times"][i["train_index"]]
    mean, rms, dead = statistics(stamps, i["omega"].real, k)
    bar = np.where(dead, 0, (i["phi"] - mean) / np.where(dead, 1, rms))
    if k("atoms not centred", False):
        bar = np.where(dead, 0, i["phi"] / np.where(dead, 1, rms))
    return {"mean": mean, "rms": np.where(dead, 0, rms), "dead": dead, "phi_bar": bar}


def appearance(i, s, k):
    x = np.einsum("cki,k->ci", i["appearance_coefficients"], i["phi_bar"])
    bound = k("beta", s["beta"]) / k("y00", Y00)
    return {"residual": bound * k("squash", np.tanh)(k("steepness", 1) * x)}


def motion(i, s, k):
    return {"translation": np.einsum("cki,k->ci", i["motion_coefficients"], i["phi"])}


def matern(i, s, k):
    c, omega = i["motion_coefficients"], i["omega"].real
    length = s["correlation_length"]
    rho = (k("matern order", 5) + (length * k("matern turn", 2 * math.pi) * omega) ** 2) ** k("matern power", 3)
    rho = rho / k("rho norm", np.mean)(rho)
    n = c.size if k("penalty mean", True) else 1
    both = np.tile(rho, 2) if not k("rho interleaved", False) else np.repeat(rho, 2)
    if k("sines only", False):
        both = np.concatenate([rho, 0 * rho])
    power = (both[:, None] * c**2).sum() / n
    return {"rho": rho, "penalty": k("penalty times", 1) * power}


def deformation(i, s, k):
    delta = i["t"] - i["fdm_centre"]
    square = i["fdm_width"] ** 2 + k("width floor", 1e-4)
    if k("width not squared", False):
        square = size(i["fdm_width"]) + 1e-4
    if s["basis"] == "quartic":
        power = (delta**2 / square) ** k("quartic power", 2)
    else:
        power = delta**2 / (k("gaussian two", 2) * square)
    bell = np.where(power.real > k("basis cut", 60 * math.log(2)), 0, np.exp(-power))
    offsets = (i["fdm_weight"] * bell).sum(1)
    return {"offsets": offsets}


def exposure(i, s, k):
    gain = np.exp(i["log_gain"])
    if k("gain linear", False):
        gain = 1 + i["log_gain"]
    out = gain[:, None, None] * i["colour"] + i["bias"][:, None, None]
    if k("bias first", False):
        out = gain[:, None, None] * (i["colour"] + i["bias"][:, None, None])
    if k("exposed clamp", False):
        out = np.where(out.real > 1, 1, out)
    return {"exposed": out}


def cross(v):
    x, y, z = v
    o = 0 * x
    return np.array([[o, -z, y], [z, o, -x], [-y, x, o]])


def pose(i, s, k):
    v = cross(i["rotation_vector"])
    e, term = np.eye(3) + 0 * v, np.eye(3) + 0 * v
    for n in range(1, k("pose terms", 60)):
        term = term @ v / n
        e = e + term
    if k("pose inverse", False):
        e = e.T
    w = i["rotation"] @ e if k("pose right", False) else e @ i["rotation"]
    d = e @ i["translation"] + i["offset"]
    if k("offset first", False):
        d = e @ (i["translation"] + i["offset"])
    if k("translation kept", False):
        d = i["translation"] + i["offset"]
    return {"corrected_rotation": w, "corrected_translation": d}


# ---- losses ----


def masked_l1(i, s, k):
    mask = i["mask"]
    e = size(select(mask, i["rendered"] - i["observed"].real, k))
    if k("squared", False):
        e = e**2
    n = k("l1 channels", 3) * (mask.size if k("l1 over all", False) else mask.sum())
    if n == 0:
        return {"loss": k("l1 empty", 0.0) + 0 * e.sum()}
    return {"loss": e.sum() / n}


def window(k):
    x = np.arange(-k("window half", 5), k("window half", 5) + 1)
    w = np.exp(-(x**2) / (k("window two", 2) * k("sigma", 1.5) ** 2))
    return w / w.sum() if k("window sum", True) else w / (1.5 * math.sqrt(2 * math.pi))


def blur(image, k):
    w = window(k)
    half, out = len(w) // 2, image
    for axis in (1, 2):
        pad = [(0, 0), (0, 0), (0, 0)]
        pad[axis] = (half, half)
        wide = np.pad(out, pad, mode=k("window border", "constant"))
        take = [np.take(wide, np.arange(n, n + out.shape[axis]), axis) for n in range(len(w))]
        out = sum(a * b for a, b in zip(w, take, strict=True))
    if k("window renormalised", False):
        one = np.ones((1, *image.shape[1:]))
        out = out / blur(one, Choices({}))
    return out


def masked_ssim(i, s, k):
    mask, (c1, c2) = i["mask"], (k("ssim c1", 1e-4), k("ssim c2", 9e-4))
    if not mask.any():
        return {"ssim": k("ssim empty", 1.0) + 0 * select(mask, i["rendered"], k).sum()}
    x = select(mask, i["rendered"], k)
    y = select(mask, i["observed"].real, k)
    if k("ssim range", 1) != 1:
        x, y = x * 255, y * 255
    mx, my = blur(x, k), blur(y, k)
    vx, vy, xy = blur(x * x, k) - mx**2, blur(y * y, k) - my**2, blur(x * y, k) - mx * my
    if k("sample variance", False):
        vx, vy, xy = (v * 121 / 120 for v in (vx, vy, xy))
    luminance = (2 * mx * my + c1) / (mx**2 + my**2 + c1)
    structure = (2 * xy + c2) / (vx + vy + c2)
    value = luminance * structure
    if k("contrast only", False):
        value = structure
    if k("ssim over all", False):
        return {"ssim": value.mean()}
    return {"ssim": (value * mask).sum() / (3 * mask.sum())}


def normalised_depth(i, s, k):
    prior, depth = i["prior_depth"].real, i["rendered_depth"]
    known = np.isfinite(prior) & (prior > 0)
    valid = known & i["mask"]
    finite = np.isfinite(depth.real)
    if valid.sum() < k("least priors", 10) or not finite.any():
        return {"loss": 0 * np.where(finite, depth, 0).sum()}
    everywhere = known if not k("prior maximum on tissue", False) else valid
    top = np.where(finite, depth.real, -np.inf)
    if k("depth maximum on tissue", False):
        top = np.where(valid, top, -np.inf)
    m = top.max()
    if m <= 0:
        return {"loss": 0 * np.where(finite, depth, 0).sum()}
    ties = top == m
    first = np.zeros_like(ties)
    first.flat[np.argmax(ties)] = True
    share = first if k("first of ties", False) else ties
    m = m + 1j * np.where(share, depth, 0).imag.sum() / (1 if k("ties summed", False) else share.sum())
    if k("maximum constant", False):
        m = m.real
    e = np.where(valid, depth, 0) / m - np.where(valid, prior, 0) / prior[everywhere].max()
    if k("depth squared", False):
        return {"loss": (e**2).sum() / valid.sum()}
    n = i["mask"].sum() if k("depth over tissue", False) else valid.sum()
    return {"loss": size(e).sum() / n}


def smoothness(i, s, k):
    depth, image, mask, edges = i["rendered_depth"], i["rendered"], i["mask"], i["edges"]
    v = mask & ~edges if not k("edges ignored", False) else mask
    f = k("variation factor", s["total_variation_factor"])
    steps = 0
    for axis in k("step axes", (0, 1)):
        cut = [np.take(a, np.arange(j, a.shape[axis] - 1 + j), axis) for a in (depth, v) for j in (0, 1)]
        jump = np.where(cut[2] & cut[3], cut[1] - cut[0], 0)
        steps = steps + (size(jump) if k("absolute steps", False) else jump**2).sum()
    loss = steps / ((v.sum() if not k("steps over all", False) else v.size) + 1e-6)
    for name, picture in (("depth variation", depth[None]), ("colour variation", image)):
        if not k(name, True):
            continue
        out = np.where(mask, 0, picture)
        if k("variation of tissue", False):
            out = np.where(mask, picture, 0)
        across = size(out[:, :, 1:] - out[:, :, :-1])
        down = size(out[:, 1:] - out[:, :-1])
        if k("no step at the border", False):
            outside = ~mask
            across = across * (outside[:, 1:] & outside[:, :-1])
            down = down * (outside[1:] & outside[:-1])
        n = out.size if not k("variation over outside", False) else len(out) * max((~mask).sum(), 1)
        loss = loss + f * (across.sum() + down.sum()) / n
    return {"loss": loss}


def reflected(x, n, k):
    rule = k("reflection", "reflect")
    if n == 1:
        return 0
    if rule == "reflect":
        x = x % (2 * (n - 1))
        return x if x < n else 2 * (n - 1) - x
    return min(max(x, 0), n - 1)


def reduce_matrix(n, k):
    d = np.zeros(((n + 1) // 2, n))
    for y in range(len(d)):
        for r, w in zip(range(-2, 3), k("pyramid filter", (1, 4, 6, 4, 1)), strict=True):
            d[y, reflected(2 * y + r + k("odd samples", 0), n, k)] += w / sum(k("pyramid filter", (1, 4, 6, 4, 1)))
    return d


def expand_matrix(n, rule, k):
    coarse = (n + 1) // 2
    u = np.zeros((n, coarse))
    rule = k("upsampling", rule)
    for x in range(n):
        j = x // 2
        if rule == "nearest":
            u[x, j] = 1
        elif rule == "co_sited":
            u[x, j] += 0.5 if x % 2 else 1
            if x % 2:
                u[x, min(j + 1, coarse - 1)] += 0.5
        else:
            u[x, j] += 0.75
            u[x, min(max(j + (1 if x % 2 else -1), 0), coarse - 1)] += 0.25
    return u


def laplacian(i, s, k):
    mask, rendered, observed = i["mask"], i["rendered"], i["observed"].real
    out, g = {}, observed
    difference = np.where(mask, rendered - observed, 0)
    support, loss = mask, 0
    for j in range(1, 4):
        h, w = g.shape[1:]
        down = [reduce_matrix(n, k) for n in (h, w)]
        up = [expand_matrix(n, s["upsampling"], k) for n in (h, w)]
        small = down[0] @ g @ down[1].T
        out[f"band_{j}"] = g - up[0] @ small @ up[1].T
        coarse = down[0] @ difference @ down[1].T
        band = difference - up[0] @ coarse @ up[1].T
        lost = (down[0] > 0).astype(float) @ (~support) @ (down[1] > 0).T.astype(float) > 0
        if k("support of the centre", False):
            lost = ~support[::2, ::2]
        valid = support & ~((up[0] > 0).astype(float) @ lost @ (up[1] > 0).T.astype(float) > 0)
        if k("up-sampled support forgotten", False):
            valid = support
        if k("fine mask", False):
            valid = support if j == 1 else valid
        out[f"valid_{j}"] = valid
        n = valid.sum() if not k("bands over all", False) else valid.size
        if n:
            weight = k("band weights", (1, 1, 1))[j - 1]
            loss = loss + weight * size(np.where(valid, band, 0)).sum() / (3 * n)
        g, difference, support = small, coarse, ~lost
    out["loss"] = loss / k("levels in the mean", 3)
    return out


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


# ---- decisions ----


def calibration(i, s, k):
    axes = (1, 2, 3)
    root = lambda g: np.sqrt((g**2).mean(axes))
    if k("norm", "rms") == "mean":
        root = lambda g: np.abs(g).mean(axes)
    if k("norm", "rms") == "sum":
        root = lambda g: np.sqrt((g**2).sum(axes))
    rgb, lap = root(i["d_photometric"].real), root(i["d_laplacian"].real)
    if k("rms over valid", False):
        n = np.array([max((g != 0).sum(), 1) for g in i["d_photometric"].real])
        rgb = np.sqrt((i["d_photometric"].real ** 2).sum(axes) / n)
    with np.errstate(all="ignore"):
        ratio = lap / rgb
    alive = np.isfinite(ratio) & (rgb > 0)
    middle = {"median": np.median, "mean": np.mean, "low": lambda a: np.sort(a)[(len(a) - 1) // 2]}
    typical = middle[k("typical", "median")](ratio[alive]) if alive.any() else 0
    if k("inverse medians", False) and alive.any():
        typical = np.median(lap[alive]) / np.median(rgb[alive])
    r = k("ratio", s["gradient_ratio"])
    lam = r / typical if typical > 0 else 0.0
    if k("ratio upside down", False) and typical > 0:
        lam = r * typical
    return {"g_rgb": rgb, "g_lap": lap, "lambda_lap": np.array(lam), "refused": np.array(typical <= 0)}


def adam(i, s, k):
    p, m, v = i["parameter"].real, 0, 0
    b1, b2, eps = k("beta1", s["beta1"]), k("beta2", s["beta2"]), k("epsilon", s["epsilon"])
    for step, g in enumerate(i["gradients"].real, k("first step", 1)):
        m, v = b1 * m + (1 - b1) * g, b2 * v + (1 - b2) * g**2
        m = np.where(np.abs(m) < 1.1754943508222875e-38, 0, m)
        top = m / (1 - b1**step) if k("first corrected", True) else m
        bottom = v / (1 - b2**step) if k("second corrected", True) else v
        if k("rmsprop", False):
            top = g
        root = np.sqrt(bottom + eps) if k("epsilon inside", False) else np.sqrt(bottom) + eps
        p = p - k("rate times", 1) * s["rate"] * top / root
        if k("weight decay", 0):
            p = p * (1 - k("weight decay", 0) * s["rate"])
    return {"parameter_after": p, "first": m, "second": v}


def schedule(i, s, k):
    c = s["config"]
    o, loss, den, tr = c["optimiser"], c["loss"], c["density"], c["training"]
    it, total, act = i["iteration"].astype(float), tr["iterations"], tr["residual_activation"]
    decay = lambda tau: o["final_factor"] ** np.clip(tau, 0, 1)
    if k("linear decay", False):
        decay = lambda tau: 1 + (o["final_factor"] - 1) * np.clip(tau, 0, 1)
    moving = decay((it - k("decay from", 0)) / total)
    late = decay((it - act) / max(total - act, 1)) if o["restart_residual_schedule"] != k("restart", False) else moving
    late = np.where(it > act + k("residual shift", 0), late, 0)
    fade = np.clip((it - o["annealing_from"]) / max(total - o["annealing_from"], 1), 0, 1)
    hold = o["annealed_factor"] ** fade
    a, b = loss["laplacian_from"], loss["laplacian_full"]
    ramp = np.clip((it - a - k("ramp shift", 0)) / max(b - a + k("ramp longer", 0), 1), 0, 1)
    fdm, on = o["deformation"], it > act + k("residual shift", 0)
    lap = 0.0 if loss["lambda_lap"] == "auto" else loss["lambda_lap"]
    degree = np.minimum(c["model"]["harmonics_degree"], (it + k("degree shift", 0)) // tr["harmonics_interval"])
    gathers = it < den["until"] + k("until shift", 0)
    densifies = gathers & (it > den["start"] + k("start shift", 0)) & (it % den["interval"] == k("interval phase", 0))
    position = o["position"] * moving if k("position decays", True) else o["position"] + 0 * it
    factor = k("position factor", o["deformation_position_factor"])
    first = loss["smoothness_from"] + k("smooth shift", 0)
    one = {
        "rate_position": position,
        "rate_quaternion": o["rotation"] * hold,
        "rate_log_scale": o["scale"] * hold,
        "rate_opacity_logit": o["opacity"] * hold,
        "rate_harmonics_base": o["harmonics_base"] * hold,
        "rate_harmonics_rest": k("rest", o["harmonics_rest"]) * hold,
        "rate_fdm_weight_position": fdm * factor * moving,
        "rate_fdm_weight_other": fdm * moving,
        "rate_fdm_centre": fdm * moving,
        "rate_fdm_width": fdm * moving,
        "rate_appearance_coefficients": fdm * o["appearance_factor"] * late,
        "rate_motion_coefficients": fdm * o["spectral_motion_factor"] * late,
        "laplacian_weight": lap * ramp * c["model"]["laplacian"],
        "degree": degree.astype(int),
        "residuals": on & (c["model"]["appearance"] | c["model"]["spectral_motion"]),
        "smoothness": (it >= first) & (loss["smoothness_weight"] > 0),
        "gathers": gathers,
        "densifies": densifies,
    }
    return {name: np.broadcast_to(value, it.shape) for name, value in one.items()}


def density(i, s, k):
    d, n = s["density"], i["position"].shape[1]
    extent = d["extent"]
    if extent == "cameras":
        eyes = np.array([-w.T @ t for w, t in zip(i["rotation_matrices"].real, i["translations"].real, strict=True)])
        extent = k("extent factor", 1.1) * np.linalg.norm(eyes - eyes.mean(0), axis=1).max()
    half = np.array([s["width"], s["height"]]) / k("half", 2)
    g = np.linalg.norm(i["d_mean2d"].real * half[:, None], axis=1)
    if k("sum of sides", False):
        g = np.abs(i["d_mean2d"].real * half[:, None]).sum(1)
    seen = i["visible"]
    visits = seen.sum(0) if not k("views counted", False) else np.full(n, len(seen))
    total = (g * seen).sum(0)
    if k("largest", False):
        mean = (g * seen).max(0)
    else:
        mean = np.where(visits > 0, total / np.maximum(visits, 1), 0)
    opacity = 1 / (1 + np.exp(-i["opacity_logit"].real))
    low = k("prune below", d["prune_opacity"])
    pruned = opacity <= low if k("prune at", False) else opacity < low
    scale = np.exp(i["log_scale"].real)
    large = {"max": scale.max(0), "min": scale.min(0), "mean": scale.mean(0)}[k("size", "max")]
    threshold = d["gradient_threshold"]
    wanted = ~pruned & (mean >= threshold)
    if k("pruned also split", False):
        wanted = mean >= threshold
    room = max(d["maximum"] - (~pruned).sum() + k("room", 0), 0)
    if wanted.sum() > room:
        best = np.lexsort((np.arange(n), -np.where(wanted, mean, -1)))[:room]
        if k("first come", False):
            best = np.flatnonzero(wanted)[:room]
        wanted &= np.isin(np.arange(n), best)
    wide = large > d["dense_fraction"] * extent
    cloned, split = wanted & ~wide, wanted & wide
    keep = np.flatnonzero(~pruned & ~split)
    parents, clones = np.flatnonzero(split), np.flatnonzero(cloned)
    q = i["quaternion"].real
    r = covariance({"quaternion": q + 0j, "log_scale": np.zeros_like(scale) + 0j}, {}, Choices({}))["rotation"].real
    noise = i["split_noise"].real[:, :, : len(parents)]
    shift = np.einsum("jkn,hkn->hjn", r[:, :, parents], scale[:, parents] * noise)
    if k("not turned", False):
        shift = scale[:, parents] * noise
    children = i["position"].real[:, parents] + k("noise times", 1) * shift
    small = i["log_scale"].real[:, parents] - math.log(k("shrink", 1.6))
    parent = np.concatenate([keep, clones, parents, parents])
    if k("children interleaved", False):
        parent = np.concatenate([keep, clones, np.repeat(parents, 2)])
        children = np.stack([children[0], children[1]], -1).reshape(1, 3, -1)
        small = np.repeat(small, 2, 1)
        kids, kid_scale = children[0], small
    else:
        kids, kid_scale = np.concatenate([children[0], children[1]], 1), np.concatenate([small, small], 1)
    old = parent[: len(keep) + len(clones)]
    kept = np.zeros(len(parent), bool)
    kept[: len(keep)] = True
    if k("clones keep moments", False):
        kept[: len(old)] = True
    return {
        "extent": np.array(extent, float),
        "mean_gradient": mean,
        "pruned": pruned,
        "cloned": cloned,
        "split": split,
        "count": np.array(len(parent)),
        "parent": parent,
        "moments_kept": kept,
        "position_after": np.concatenate([i["position"].real[:, old], kids], 1),
        "log_scale_after": np.concatenate([i["log_scale"].real[:, old], kid_scale], 1),
    }


def initialisation(i, s, k):
    camera, train, setting = s["camera"], i["train_index"], s["initialisation"]
    h, w = i["masks"].shape[1:]
    x, y = np.arange(w) + k("pixel", 0.5), (np.arange(h) + k("pixel", 0.5))[:, None]
    usable = i["masks"] & (i["prior_depths"].real > 0)
    points, colours = [], []
    for number, frame in enumerate(train):
        if number and len(i["masks"]) > k("long clip", 150) and (frame - train[0]) % 2 == k("parity", 0):
            continue
        depth = i["prior_depths"].real[frame]
        take = usable[frame]
        if number:
            moved = np.abs(depth - i["prior_depths"].real[train[0]]) > k("threshold", setting["motion_threshold"])
            take = take & (~usable[train[0]] | moved)
            if k("moved only", False):
                take = usable[frame] & usable[train[0]] & moved
        p = np.array(
            [(x - camera["cx"]) * depth / camera["fx"], (y - camera["cy"]) * depth / camera["fy"], depth + 0 * x]
        )
        p = p[:, take] - i["translations"].real[frame][:, None]
        r = i["rotation_matrices"].real[frame]
        points.append((r if k("lifted with W", False) else r.T) @ p)
        colours.append((i["images"].real[frame] / 255)[:, take])
    points, colours = np.concatenate(points, 1), np.concatenate(colours, 1)
    n, model = points.shape[1], s["model"]
    gap = ((points[:, :, None] - points[:, None]) ** 2).sum(0)
    gap[np.arange(n), np.arange(n)] = np.inf
    near = np.sort(gap, 1)[:, : min(k("neighbours", 3), max(n - 1, 0))]
    mean = near.mean(1) if near.shape[1] else np.zeros(n)
    if k("mean of distances", False) and near.shape[1]:
        mean = np.sqrt(near).mean(1) ** 2
    h0 = np.zeros(((model["harmonics_degree"] + 1) ** 2, 3, n))
    h0[0] = (colours - k("colour zero", 0.5)) / Y00
    b = model["bases"]
    centre = np.linspace(0, 1, b) if k("centres at ends", True) else (np.arange(b) + 0.5) / b
    return {
        "count": np.array(n),
        "position": points,
        "log_scale": np.tile(np.log(np.maximum(mean, 1e-7)) / 2, (3, 1)),
        "harmonics": h0,
        "quaternion": np.tile(np.array([[1.0], [0], [0], [0]]), n),
        "opacity_logit": np.full(n, math.log(k("opacity", 0.1) / (1 - k("opacity", 0.1)))),
        "fdm_weight": np.zeros((10, b, n)),
        "fdm_centre": np.tile(centre[:, None], (10, 1, n)),
        "fdm_width": np.full((10, b, n), k("width", model["initial_width"])),
    }


def scene(i, s, k):
    model, t = s["model"], s["t"]
    omega = frequencies(
        {}, {"count": model["frequencies"], "low": model["frequency_min"], "high": model["frequency_max"]}, k
    )["omega"]
    phi = waves(t, omega, k)
    mean, rms, dead = statistics(i["times"].real[i["train_index"]], omega, k)
    bar = np.where(dead, 0, (phi - mean) / np.where(dead, 1, rms))
    offsets = deformation(i | {"t": t}, model, k)["offsets"]
    moved = i["position"] + offsets[:3] + np.einsum("cki,k->ci", i["motion_coefficients"], phi)
    if k("channels swapped", False):
        offsets = np.concatenate([offsets[:3], offsets[6:10], offsets[3:6]])
    tint = appearance(i | {"phi_bar": phi if k("raw atoms for colour", False) else bar}, model, k)["residual"]
    return {
        "position_at_t": moved,
        "quaternion_at_t": i["quaternion"] + offsets[3:7],
        "log_scale_at_t": i["log_scale"] + offsets[7:],
        "residual_at_t": tint,
    }


def render(i, s, k):
    shape = covariance(i, s, k)
    mean, cover, det, z, seen = projected(i | shape, s, k)
    mean = mean + 1j * i.get("mean2d", np.zeros_like(mean)).imag
    centre = -i["rotation_matrix"].T @ i["translation"]
    colour = harmonics(i | {"centre": centre}, {"degree": s["degree"]}, k)["colour"]
    width, height = s["camera"]["width"], s["camera"]["height"]
    out = blended(mean, cover, det, z, seen, i["opacity_logit"], colour, i["background"], s["raster"], width, height, k)
    return out | {"visible": boxed(mean.real, cover.real, seen, i["opacity_logit"].real, s["raster"], width, height)}


def boxed(mean, cover, seen, logit, raster, width, height):
    """Whether the box of the ellipse holds a pixel centre."""
    with np.errstate(all="ignore"):
        reach = np.sqrt(2 * np.log(1 / (1 + np.exp(-logit)) / raster["alpha_cutoff"]))
    inside = seen & np.isfinite(reach)
    for centre, variance, n in ((mean[0], cover[0], width), (mean[1], cover[2], height)):
        half = reach * np.sqrt(variance)
        first, last = np.ceil(centre - half - 0.5), np.floor(centre + half - 0.5)
        inside &= np.minimum(last, n - 1) >= np.maximum(first, 0)
    return inside


STAGES = (
    frequencies,
    dictionary,
    atoms,
    appearance,
    motion,
    matern,
    deformation,
    exposure,
    pose,
    masked_l1,
    masked_ssim,
    normalised_depth,
    smoothness,
    laplacian,
    covariance,
    projection,
    harmonics,
    composite,
    calibration,
    adam,
    schedule,
    density,
    initialisation,
    scene,
    render,
)
OPERATIONS = {f.__name__: f for f in STAGES}


def port(operation, inputs, settings, wrong=None):
    """Outputs of a case by name, with the replaced choices of `wrong`; None for an operation that is not ported."""
    if operation not in OPERATIONS:
        return None
    f, wrong = OPERATIONS[operation], wrong or {}
    forward = {} if wrong.get("reverse only") else wrong
    reverse = {} if wrong.get("forward only") else wrong
    real = {n: a for n, a in inputs.items() if not n.startswith("d_") or operation in ("calibration", "density")}
    taken = {n: a + 0j if a.dtype.kind == "f" else a for n, a in real.items()}
    with np.errstate(all="ignore"):
        out = {n: np.asarray(v) for n, v in f(taken, settings, Choices(forward)).items()}
        out = {n: v.real if v.dtype.kind == "c" else v for n, v in out.items()}
        out |= gradients(f, taken, {n: inputs[f"d_{n}"] for n in out if f"d_{n}" in inputs}, settings, reverse)
    for change in wrong.get("afterwards", ()):
        out = change(operation, out, inputs, settings)
    return out


def gradients(f, taken, given, settings, wrong):
    """The derivative of the sum of the outputs, weighted with the given numbers, by every entry of every input."""
    found = {}
    if not given:
        return found
    sources = taken
    if f is render:
        sources = taken | {"mean2d": np.zeros((2, len(taken["opacity_logit"])), complex)}
    for name, array in sources.items():
        if array.dtype.kind != "c":
            continue
        slope = np.zeros(array.shape)
        for at in np.ndindex(array.shape):
            moved = np.array(array)
            moved[at] += 1j * STEP
            out = f(sources | {name: moved}, settings, Choices(wrong))
            slope[at] = (
                sum(np.where(np.imag(out[n]) == 0, 0, d * np.imag(out[n])).sum() for n, d in given.items()) / STEP
            )
        found[f"d_{name}"] = slope
    return found
