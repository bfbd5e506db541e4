"""The decisions of training of the port by hand: (6), (7), (B10) to (B12), and how files are read."""

import numpy as np
from hand_screen import rotation_of, unit_quaternion
from hand_time import Y00

MASK = (1 << 64) - 1


def reading(i, s):
    height, width = i["mask"].shape
    return {
        "column": i["harmonics"][:, :, s["gaussian"]],
        "flat": i["harmonics"].ravel(),
        "scalar": i["scalar"],
        "empty": i["empty"],
        "tissue_pixels": i["mask"].sum(),
        "tissue_row": np.flatnonzero(i["mask"][s["row"]]),
        "sample_x": np.arange(width) + 0.5,
        "sample_y": np.arange(height) + 0.5,
    }


def generator(i, s):
    state = 0xCBF29CE484222325
    for byte in s["seed"].encode():
        state = ((state ^ byte) * 0x100000001B3) & MASK
    words = []
    for k in range(1, s["count"] + 1):
        z = (state + k * 0x9E3779B97F4A7C15) & MASK
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        words.append(z ^ (z >> 31))
    words = np.array(words, np.uint64)
    return {"words": words, "unit_numbers": (words >> np.uint64(40)).astype(float) / 2**24}


# ---- (7) calibration ----


def rms(gradient):
    return np.sqrt((gradient**2).mean((1, 2, 3)))


def calibration(i, s):
    g_rgb, g_lap = rms(i["d_photometric"]), rms(i["d_laplacian"])
    valid = np.isfinite(g_rgb) & np.isfinite(g_lap) & (g_rgb > 0)
    ratios = g_lap[valid] / g_rgb[valid]
    ratios = ratios[np.isfinite(ratios)]
    typical = np.median(ratios) if len(ratios) else 0
    weight = s["gradient_ratio"] / typical if typical > 0 else 0.0
    return {"g_rgb": g_rgb, "g_lap": g_lap, "lambda_lap": weight, "refused": typical <= 0}


# ---- (B10) Adam ----


def adam(i, s):
    beta1, beta2 = s["beta1"], s["beta2"]
    theta = i["parameter"]
    m = v = np.zeros(theta.shape)
    for k, g in enumerate(i["gradients"], start=1):
        m = beta1 * m + (1 - beta1) * g
        v = beta2 * v + (1 - beta2) * g**2
        m = np.where(np.abs(m) < 1.1754943508222875e-38, 0, m)
        m_hat, v_hat = m / (1 - beta1**k), v / (1 - beta2**k)
        theta = theta - s["rate"] * m_hat / (np.sqrt(v_hat) + s["epsilon"])
    return {"parameter_after": theta, "first": m, "second": v}


# ---- (6) schedules ----


def schedule(i, s):
    config = s["config"]
    model, loss, den, opt, run = (config[k] for k in ("model", "loss", "density", "optimiser", "training"))
    it, total, start = i["iteration"].astype(float), run["iterations"], run["residual_activation"]
    moving = opt["final_factor"] ** np.clip(it / total, 0, 1)
    late = opt["final_factor"] ** np.clip((it - start) / max(total - start, 1), 0, 1)
    if not opt["restart_residual_schedule"]:
        late = moving
    evaluated = (it > start) & (model["appearance"] or model["spectral_motion"])
    late = np.where(evaluated, late, 0)
    from_ = opt["annealing_from"]
    fade = np.clip((it - from_) / (total - from_), 0, 1) if total > from_ else 0 * it
    held = opt["annealed_factor"] ** fade
    first, full = loss["laplacian_from"], loss["laplacian_full"]
    ramp = np.clip((it - first) / max(full - first, 1), 0, 1)
    weight = 0 if loss["lambda_lap"] == "auto" or not model["laplacian"] else loss["lambda_lap"]
    fdm = opt["deformation"] * moving
    gathers = it < den["until"]
    return {
        "rate_position": opt["position"] * moving,
        "rate_quaternion": opt["rotation"] * held,
        "rate_log_scale": opt["scale"] * held,
        "rate_opacity_logit": opt["opacity"] * held,
        "rate_harmonics_base": opt["harmonics_base"] * held,
        "rate_harmonics_rest": opt["harmonics_rest"] * held,
        "rate_fdm_weight_position": fdm * opt["deformation_position_factor"],
        "rate_fdm_weight_other": fdm,
        "rate_fdm_centre": fdm,
        "rate_fdm_width": fdm,
        "rate_appearance_coefficients": opt["deformation"] * opt["appearance_factor"] * late,
        "rate_motion_coefficients": opt["deformation"] * opt["spectral_motion_factor"] * late,
        "laplacian_weight": weight * ramp,
        "degree": np.minimum(model["harmonics_degree"], it // run["harmonics_interval"]).astype(int),
        "residuals": evaluated,
        "smoothness": (it >= loss["smoothness_from"]) & (loss["smoothness_weight"] > 0),
        "gathers": gathers,
        "densifies": gathers & (it > den["start"]) & (it % den["interval"] == 0),
    }


# ---- (B11) density control ----


def camera_extent(rotations, translations):
    centres = np.array([-w.T @ d for w, d in zip(rotations, translations, strict=True)])
    return 1.1 * np.linalg.norm(centres - centres.mean(0), axis=1).max()


def density(i, s):
    d, n = s["density"], len(i["opacity_logit"])
    extent = d["extent"]
    if extent == "cameras":
        extent = camera_extent(i["rotation_matrices"], i["translations"])
    scaled = i["d_mean2d"] * np.array([s["width"] / 2, s["height"] / 2])[:, None]
    norms = np.sqrt((scaled**2).sum(1))
    visits = i["visible"].sum(0)
    mean = np.where(i["visible"], norms, 0).sum(0) / np.maximum(visits, 1)
    pruned = 1 / (1 + np.exp(-i["opacity_logit"])) < d["prune_opacity"]
    chosen = ~pruned & ((mean > 0) if d["growth"] == "budget" else (mean >= d["gradient_threshold"]))
    room = max(d["maximum"] - (~pruned).sum(), 0)
    if chosen.sum() > room:
        order = np.argsort(np.where(chosen, -mean, np.inf), kind="stable")[:room]
        chosen = np.isin(np.arange(n), order) & chosen
    largest = np.exp(i["log_scale"]).max(0)
    split = chosen & (largest > d["dense_fraction"] * extent)
    cloned = chosen & ~split
    stay, copies, parents = np.flatnonzero(~pruned & ~split), np.flatnonzero(cloned), np.flatnonzero(split)
    rotation = rotation_of(unit_quaternion(i["quaternion"][:, parents])[0])
    axes = np.exp(i["log_scale"][:, parents])
    children = []
    for noise in i["split_noise"][:, :, : len(parents)]:
        children.append(i["position"][:, parents] + np.einsum("jkn,kn->jn", rotation, axes * noise))
    smaller = i["log_scale"][:, parents] - np.log(1.6)
    kept = np.concatenate([stay, copies])
    parent = np.concatenate([kept, parents, parents])
    return {
        "extent": extent,
        "mean_gradient": mean,
        "pruned": pruned,
        "cloned": cloned,
        "split": split,
        "count": len(parent),
        "parent": parent,
        "moments_kept": np.arange(len(parent)) < len(stay),
        "position_after": np.concatenate([i["position"][:, kept], *children], 1),
        "log_scale_after": np.concatenate([i["log_scale"][:, kept], smaller, smaller], 1),
    }


# ---- (B12) initialisation ----


def candidates(i, s, k):
    first = i["train_index"][0]
    tissue = i["masks"][k] & (i["prior_depths"][k] > 0)
    if k == first:
        return tissue
    if len(i["masks"]) > 150 and (k - first) % 2 == 0:
        return tissue & False
    known = i["masks"][first] & (i["prior_depths"][first] > 0)
    moved = np.abs(i["prior_depths"][k] - i["prior_depths"][first]) > s["initialisation"]["motion_threshold"]
    return tissue & (~known | moved)


def lifted(i, s, k, taken):
    camera = s["camera"]
    row, column = np.nonzero(taken)
    depth = i["prior_depths"][k][taken]
    x = (column + 0.5 - camera["cx"]) * depth / camera["fx"]
    y = (row + 0.5 - camera["cy"]) * depth / camera["fy"]
    view = np.array([x, y, depth]) - i["translations"][k][:, None]
    return i["rotation_matrices"][k].T @ view


def neighbour_distance(points):
    """Mean squared distance to the three nearest other points."""
    n = points.shape[1]
    squared = ((points[:, :, None] - points[:, None, :]) ** 2).sum(0)
    squared[np.arange(n), np.arange(n)] = np.inf
    nearest = np.sort(squared, 1)[:, : min(3, n - 1)]
    return nearest.mean(1) if n > 1 else np.zeros(n)


def initialisation(i, s):
    model = s["model"]
    taken = {k: candidates(i, s, k) for k in i["train_index"]}
    points = np.concatenate([lifted(i, s, k, t) for k, t in taken.items()], 1)
    colours = np.concatenate([i["images"][k][:, t] / 255 for k, t in taken.items()], 1)
    n, bases = points.shape[1], model["bases"]
    h = np.zeros(((model["harmonics_degree"] + 1) ** 2, 3, n))
    h[0] = (colours - 0.5) / Y00
    axis = np.log(np.sqrt(np.maximum(neighbour_distance(points), 1e-7)))
    quaternion = np.zeros((4, n))
    quaternion[0] = 1
    return {
        "count": n,
        "position": points,
        "log_scale": np.tile(axis, (3, 1)),
        "harmonics": h,
        "quaternion": quaternion,
        "opacity_logit": np.full(n, np.log(0.1 / 0.9)),
        "fdm_weight": np.zeros((10, bases, n)),
        "fdm_centre": np.tile(np.linspace(0, 1, bases)[:, None], (10, 1, n)),
        "fdm_width": np.full((10, bases, n), model["initial_width"]),
    }
