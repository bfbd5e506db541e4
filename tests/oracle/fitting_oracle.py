"""Schedules (6), (B10), density control (B11) and initialisation (B12), one number at a time."""

import math

import numpy as np

from oracle.splatting_oracle import rotation

Y00 = math.sqrt(1 / (4 * math.pi))


def decay(start, phi, step, steps):
    """Exponential from `start` to phi start; tau is cut to [0, 1]."""
    return start * math.exp(math.log(phi) * min(max(step / steps, 0.0), 1.0))


def schedule(i, c):
    """Rates, weights and switches of iteration i under configuration c."""
    o, t = c["optimiser"], c["training"]
    total, born, phi = t["iterations"], t["residual_activation"], o["final_factor"]
    base = decay(o["deformation"], phi, i, total)
    late = (i - born, total - born) if o["restart_residual_schedule"] else (i, total)
    residual = decay(o["deformation"], phi, *late) if i > born else 0.0
    rates = {
        "position": decay(o["position"], phi, i, total),
        "quaternion": o["rotation"], "log_scale": o["scale"], "opacity_logit": o["opacity"],
        "harmonics_base": o["harmonics_base"], "harmonics_rest": o["harmonics_rest"],
        "fdm_weight_position": base * o["deformation_position_factor"], "fdm_weight_other": base,
        "fdm_centre": base, "fdm_width": base,
        "appearance_coefficients": residual * o["appearance_factor"],
        "motion_coefficients": residual * o["spectral_motion_factor"],
    }  # fmt: skip
    first, full = c["loss"]["laplacian_from"], c["loss"]["laplacian_full"]
    d = c["density"]
    return {f"rate_{name}": value for name, value in rates.items()} | {
        "laplacian_weight": c["loss"]["lambda_lap"] * min(1.0, max(0.0, (i - first) / (full - first))),
        "degree": min(c["model"]["harmonics_degree"], i // t["harmonics_interval"]),
        "residuals": i > born,
        "smoothness": i >= c["loss"]["smoothness_from"],
        "gathers": i < d["until"],
        "densifies": d["start"] < i < d["until"] and i % d["interval"] == 0,
    }


def extent(setting, turned, shifts):
    """Scene units; from the optical centres of moving cameras, or a number."""
    if setting != "cameras":
        return setting
    centres = [-w.T @ d for w, d in zip(turned, shifts)]
    middle = np.mean(centres, axis=0)
    return 1.1 * max(math.dist(c, middle) for c in centres)


def mean_gradient(d_mean, visible, width, height):
    """Of one Gaussian: d_mean (views, 2), visible (views,)."""
    norms = [math.hypot(width / 2 * g[0], height / 2 * g[1]) for g, seen in zip(d_mean, visible) if seen]
    return sum(norms) / len(norms) if norms else 0.0


def density(i, s):
    """Who is pruned, cloned and split, and what stands where afterwards."""
    d, count = s["density"], i["opacity_logit"].size
    reach = extent(d["extent"], i["rotation_matrices"], i["translations"])
    steep = [mean_gradient(i["d_mean2d"][:, :, n], i["visible"][:, n], s["width"], s["height"]) for n in range(count)]
    pruned = [1 / (1 + math.exp(-i["opacity_logit"][n])) < d["prune_opacity"] for n in range(count)]
    chosen = [n for n in range(count) if not pruned[n] and steep[n] >= d["gradient_threshold"]]
    room = d["maximum"] - pruned.count(False)
    chosen = sorted(sorted(chosen, key=lambda n: (-steep[n], n))[: max(room, 0)])
    large = [max(math.exp(v) for v in i["log_scale"][:, n]) > d["dense_fraction"] * reach for n in range(count)]
    clones, splits = [n for n in chosen if not large[n]], [n for n in chosen if large[n]]
    kept = [n for n in range(count) if not pruned[n] and n not in splits]
    parents = kept + clones + splits + splits
    places, sizes = [i["position"][:, n] for n in kept + clones], [i["log_scale"][:, n] for n in kept + clones]
    for child in range(2):
        for k, n in enumerate(splits):
            q = i["quaternion"][:, n : n + 1]
            turn = rotation(q)[:, :, 0] if q.any() else np.eye(3)
            places.append(i["position"][:, n] + turn @ (np.exp(i["log_scale"][:, n]) * i["split_noise"][child, :, k]))
            sizes.append(i["log_scale"][:, n] - math.log(1.6))
    return {
        "extent": reach, "mean_gradient": steep, "pruned": pruned, "count": len(parents), "parent": parents,
        "cloned": [n in clones for n in range(count)], "split": [n in splits for n in range(count)],
        "moments_kept": [k < len(kept) for k in range(len(parents))],
        "position_after": np.reshape(places, (-1, 3)).T, "log_scale_after": np.reshape(sizes, (-1, 3)).T,
    }  # fmt: skip


def candidates(i, threshold):
    """(frame, row, column) of every pixel that becomes a Gaussian if all are taken."""
    train, depth, masks = list(i["train_index"]), i["prior_depths"], i["masks"]
    first, found = train[0], []
    for k in train:
        if k > first and len(depth) > 150 and (k - first) % 2 == 0:
            continue
        for y, x in np.ndindex(depth.shape[1:]):
            if not (masks[k, y, x] and depth[k, y, x] > 0):
                continue
            known = masks[first, y, x] and depth[first, y, x] > 0
            if k == first or not known or abs(depth[k, y, x] - depth[first, y, x]) > threshold:
                found.append((k, y, x))
    return found


def initialisation(i, s):
    """Positions, sizes and colours of the first Gaussians."""
    lens, degree = s["camera"], s["model"]["harmonics_degree"]
    pixels = candidates(i, s["initialisation"]["motion_threshold"])
    points = []
    for k, y, x in pixels:
        z = i["prior_depths"][k, y, x]
        ray = np.array([(x + 0.5 - lens["cx"]) / lens["fx"], (y + 0.5 - lens["cy"]) / lens["fy"], 1.0])
        points.append(i["rotation_matrices"][k].T @ (ray * z - i["translations"][k]))
    sizes = []
    for n, point in enumerate(points):
        near = sorted(math.dist(point, other) ** 2 for m, other in enumerate(points) if m != n)[:3]
        sizes.append(0.5 * math.log(max(sum(near) / max(len(near), 1), 1e-7)))
    harmonics = np.zeros(((degree + 1) ** 2, 3, len(points)))
    for n, (k, y, x) in enumerate(pixels):
        harmonics[0, :, n] = (i["images"][k, :, y, x] / 255 - 0.5) / Y00
    return {"count": len(points), "position": np.array(points).T, "log_scale": np.tile(sizes, (3, 1)),
            "harmonics": harmonics}  # fmt: skip
