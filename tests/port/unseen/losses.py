"""The losses of the independent port."""

import math

import numpy as np
from moving import Choices, select, size

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
