"""The decisions of training of the independent port."""

import math

import numpy as np
from moving import Y00, Choices
from screen import covariance

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
    any_residual = c["model"]["appearance"] or c["model"]["spectral_motion"]
    late = np.where((it > act + k("residual shift", 0)) & any_residual, late, 0)
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
    wanted = ~pruned & ((mean > 0) if d["growth"] == "budget" else (mean >= threshold))
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
