"""A port in PyTorch: forward passes only, gradients by automatic differentiation. python port.py REQUESTS OUTPUTS

It answers the operations up to level 2 and `render`, in presets exact and paper; the deviations of preset legacy are no
derivatives, and its cases are left out. Every function takes tensors by name and settings, and returns outputs by name.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
import torch

Y00 = 0.28209479177387814
C1, C2 = 0.01**2, 0.03**2


def turns(omega, t):
    """Sines, then cosines; whole turns are removed first."""
    phase = omega * t
    phase = 2 * math.pi * (phase - torch.round(phase).detach())
    return torch.cat([torch.sin(phase), torch.cos(phase)])


def dictionary(i, s):
    return {"phi": turns(i["omega"], i["t"])}


def appearance(i, s):
    argument = torch.einsum("cai,a->ci", i["appearance_coefficients"], i["phi_bar"])
    e = torch.exp(-2 * argument.detach().abs())
    slope = 4 * e / (1 + e) ** 2  # in place of torch's own 1 - tanh^2, which loses its digits far out
    bounded = torch.tanh(argument).detach() + slope * (argument - argument.detach())
    return {"residual": s["beta"] / Y00 * bounded}


def motion(i, s):
    return {"translation": torch.einsum("cai,a->ci", i["motion_coefficients"], i["phi"])}


def matern(i, s):
    c = i["motion_coefficients"]
    rho = (5 + (s["correlation_length"] * 2 * math.pi * i["omega"].detach()) ** 2) ** 3
    rho = rho / rho.mean()
    return {"rho": rho, "penalty": (torch.cat([rho, rho])[:, None] * c**2).sum() / c.numel()}


def deformation(i, s):
    square = i["fdm_width"] ** 2 + 1e-4
    u = (i["t"] - i["fdm_centre"]) ** 2 / square
    power = u**2 if s["basis"] == "quartic" else u / 2
    basis = torch.where(power > 60 * math.log(2), torch.zeros_like(power), torch.exp(-power))
    return {"offsets": (i["fdm_weight"] * basis).sum(1)}


def exposure(i, s):
    return {"exposed": torch.exp(i["log_gain"])[:, None, None] * i["colour"] + i["bias"][:, None, None]}


def pose(i, s):
    x, y, z = i["rotation_vector"]
    zero = torch.zeros_like(x)
    e = torch.linalg.matrix_exp(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3))
    moved = e @ i["translation"] + i["offset"]
    return {"corrected_rotation": e @ i["rotation"], "corrected_translation": moved}


# ---- losses; a masked value is selected before it is used ----


def difference(i):
    mask = i["mask"]
    zero = torch.zeros_like(i["rendered"])
    return torch.where(mask, i["rendered"], zero), torch.where(mask, i["observed"].detach(), zero)


def masked_l1(i, s):
    x, y = difference(i)
    return {"loss": (x - y).abs().sum() / max(3 * int(i["mask"].sum()), 1)}


def blurred(image):
    k = torch.arange(-5, 6, dtype=image.dtype)
    w = torch.exp(-(k**2) / (2 * 1.5**2))
    w = w / w.sum()
    rows = torch.nn.functional.conv2d(image[:, None], w[None, None, :, None], padding=(5, 0))
    return torch.nn.functional.conv2d(rows, w[None, None, None, :], padding=(0, 5))[:, 0]


def masked_ssim(i, s):
    x, y = difference(i)
    if not i["mask"].any():
        return {"ssim": 1 + 0 * x.sum()}
    mx, my = blurred(x), blurred(y)
    vx, vy, cov = blurred(x * x) - mx**2, blurred(y * y) - my**2, blurred(x * y) - mx * my
    similarity = (2 * mx * my + C1) * (2 * cov + C2) / ((mx**2 + my**2 + C1) * (vx + vy + C2))
    return {"ssim": similarity[:, i["mask"]].mean()}


def normalised_depth(i, s):
    depth, prior = i["rendered_depth"], i["prior_depth"].detach()
    known = torch.isfinite(prior) & (prior > 0)
    valid = known & i["mask"]
    depth = torch.where(torch.isfinite(depth), depth, torch.zeros_like(depth))
    if int(valid.sum()) < 10 or float(depth.detach().max()) <= 0:
        return {"loss": 0 * depth.sum()}
    largest, largest_prior = torch.amax(depth), prior[known].max()
    residual = depth[valid] / largest - prior[valid] / largest_prior
    return {"loss": residual.abs().mean()}


def smoothness(i, s):
    depth, image, mask = i["rendered_depth"], i["rendered"], i["mask"]
    v = (mask & ~i["edges"]).to(depth.dtype)
    steps = ((depth[:, 1:] - depth[:, :-1]) ** 2 * v[:, 1:] * v[:, :-1]).sum()
    steps = steps + ((depth[1:] - depth[:-1]) ** 2 * v[1:] * v[:-1]).sum()
    loss = steps / (v.sum() + 1e-6)
    for picture in (depth[None], image):
        out = torch.where(mask, torch.zeros_like(picture), picture)
        variation = (out[:, :, 1:] - out[:, :, :-1]).abs().sum() + (out[:, 1:] - out[:, :-1]).abs().sum()
        loss = loss + s["total_variation_factor"] * variation / out.numel()
    return {"loss": loss}


# ---- the rasteriser ----


def rotation_of(raw):
    """R of the normalised quaternion; zero is the identity."""
    zero = (raw == 0).all(0)
    safe = torch.where(zero, torch.tensor([[1.0], [0], [0], [0]], dtype=raw.dtype), raw)
    w, x, y, z = safe / safe.norm(dim=0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row) for row in rows])


def covariance(i, s):
    return {"rotation": rotation_of(i["quaternion"]), "scale": torch.exp(i["log_scale"].clamp(-40, 40))}


def projected(i, s):
    """Mean, covariance, determinant, depth and visibility; invisible ones are projected at z = 1."""
    r, camera = s["raster"], s["camera"]
    p = i["rotation_matrix"] @ i["position"] + i["translation"][:, None]
    seen = p[2] > r["near"]
    x, y, z = p[0], p[1], torch.where(seen, p[2], torch.ones_like(p[2]))
    fx, fy = camera["fx"], camera["fy"]
    sx, sy = x / z, y / z
    mean = torch.stack([fx * sx + camera["cx"], fy * sy + camera["cy"]])
    if r["jacobian_clamp"] > 0:
        limit = [
            r["jacobian_clamp"] * camera[side] / (2 * camera[f]) for side, f in (("width", "fx"), ("height", "fy"))
        ]
        sx, sy = sx.clamp(-limit[0], limit[0]), sy.clamp(-limit[1], limit[1])
    o = torch.zeros_like(z)
    jacobian = torch.stack([torch.stack([fx / z, o, -fx * sx / z]), torch.stack([o, fy / z, -fy * sy / z])])
    t = torch.einsum("ajn,jk,kln->aln", jacobian, i["rotation_matrix"], i["rotation"]) * i["scale"]
    a, b, c = (t[0] ** 2).sum(0) + r["low_pass"], (t[0] * t[1]).sum(0), (t[1] ** 2).sum(0) + r["low_pass"]
    cross = [t[0, k] * t[1, l] - t[0, l] * t[1, k] for k, l in ((0, 1), (1, 2), (2, 0))]
    det = r["low_pass"] ** 2 + r["low_pass"] * (t**2).sum((0, 1)) + sum(area**2 for area in cross)
    return mean, torch.stack([a, b, c]), det, z, seen


def projection(i, s):
    mean, cover, _, z, seen = projected(i, s)
    kept = [torch.where(seen, value, torch.zeros_like(value)) for value in (mean, cover, z)]
    return dict(zip(("mean2d", "covariance2d", "depth"), kept)) | {"visible": seen}


def harmonics(i, s):
    h = i["harmonics"]
    v = i["position"] - i["centre"][:, None]
    here = (v == 0).all(0)
    v = torch.where(here, torch.ones_like(v), v)
    x, y, z = v / v.norm(dim=0)
    xx, yy, zz = x * x, y * y, z * z
    c1, c3 = 0.4886025119029199, (0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154)
    basis = [
        -c1 * y, c1 * z, -c1 * x,
        1.0925484305920792 * x * y, -1.0925484305920792 * y * z, 0.31539156525252005 * (2 * zz - xx - yy),
        -1.0925484305920792 * x * z, 0.5462742152960396 * (xx - yy),
        -c3[0] * y * (3 * xx - yy), c3[1] * x * y * z, -c3[2] * y * (4 * zz - xx - yy),
        c3[3] * z * (2 * zz - 3 * xx - 3 * yy), -c3[2] * x * (4 * zz - xx - yy),
        1.445305721320277 * z * (xx - yy), -c3[0] * x * (xx - 3 * yy),
    ]  # fmt: skip
    value = 0.5 + Y00 * (h[0] + i["residual"])
    for k in range(1, (s["degree"] + 1) ** 2):
        value = value + torch.where(here, torch.zeros_like(x), basis[k - 1]) * h[k]
    return {"colour": torch.where(value >= 0, value, torch.zeros_like(value))}


def blended(mean, cover, det, z, seen, opacity, colour, background, raster, size):
    """The three images, one Gaussian after the other, nearest first."""
    width, height = size
    kind = mean.dtype
    x, y = torch.arange(width, dtype=kind) + 0.5, torch.arange(height, dtype=kind)[:, None] + 0.5
    left, live = torch.ones(height, width, dtype=kind), torch.ones(height, width, dtype=torch.bool)
    image, depth, total = torch.zeros(3, height, width, dtype=kind), 0 * left, 0 * left
    for n in torch.argsort(z.detach(), stable=True).tolist():
        if not seen[n]:
            continue
        _, b, c = cover[:, n]
        dy = y - mean[1, n]
        eta = (x - mean[0, n]) - b / c * dy
        value = opacity[n] * torch.exp(-(dy * dy / c + c / det[n] * eta * eta) / 2)
        alpha = torch.where(value > raster["alpha_max"], torch.full_like(value, raster["alpha_max"]), value)
        drawn = live & (alpha.detach() >= raster["alpha_cutoff"])
        ends = drawn & ((left * (1 - alpha)).detach() < raster["transmittance_stop"])
        live, drawn = live & ~ends, drawn & ~ends
        weight = torch.where(drawn, alpha * left, torch.zeros_like(left))
        image, depth, total = image + weight * colour[:, n, None, None], depth + weight * z[n], total + weight
        left = torch.where(drawn, left * (1 - alpha), left)
    image = image + left * background[:, None, None]
    return {"colour_image": image, "depth_image": depth, "opacity_image": total}


def composite(i, s):
    a, b, c = i["covariance2d"]
    seen = torch.ones_like(i["depth"], dtype=torch.bool)
    opacity, size = torch.sigmoid(i["opacity_logit"]), (s["width"], s["height"])
    screen = i["mean2d"], i["covariance2d"], a * c - b * b, i["depth"], seen, opacity
    return blended(*screen, i["colour"], i["background"], s["raster"], size)


def render(i, s):
    shape = covariance(i, s)
    mean, cover, det, z, seen = projected(i | shape, s)
    mean.retain_grad()
    centre = -i["rotation_matrix"].T @ i["translation"]
    colour = harmonics(i | {"centre": centre}, s)["colour"]
    size = s["camera"]["width"], s["camera"]["height"]
    opacity = torch.sigmoid(i["opacity_logit"])
    images = blended(mean, cover, det, z, seen, opacity, colour, i["background"], s["raster"], size)
    return images | {"mean2d": mean}


OPERATIONS = {f.__name__: f for f in (
    dictionary, appearance, motion, matern, deformation, exposure, pose, masked_l1, masked_ssim, normalised_depth,
    smoothness, covariance, projection, harmonics, composite, render,
)}  # fmt: skip


def answer(operation, inputs, settings):
    """Outputs, and the gradient of their sum weighted with the given derivatives; None for what is not ported."""
    if operation not in OPERATIONS or settings.get("preset") == "legacy":
        return None
    taken = {n: torch.tensor(a, requires_grad=a.dtype.kind == "f") for n, a in inputs.items() if not n.startswith("d_")}
    out = OPERATIONS[operation](taken, settings)
    given = {n: torch.tensor(inputs[f"d_{n}"]) for n in out if f"d_{n}" in inputs}
    sum((d * out[n]).sum() for n, d in given.items()).backward()
    leaves = {n: t for n, t in taken.items() if t.requires_grad}
    if operation == "render":
        leaves["mean2d"] = out.pop("mean2d")
    gradients = {f"d_{n}": torch.zeros_like(t) if t.grad is None else t.grad for n, t in leaves.items()}
    return {n: value.detach().numpy() for n, value in (out | gradients).items()}


def main(requests, outputs):
    """Answer every case that is ported."""
    head = json.loads((requests / "requests.json").read_text())
    for case in head["cases"]:
        request = json.loads((requests / case / "request.json").read_text())
        inputs = {name: np.load(requests / case / file) for name, file in request["inputs"].items()}
        real = {name: a.astype(head["precision"]) if a.dtype.kind == "f" else a for name, a in inputs.items()}
        found = answer(request["operation"], real, request["settings"]) or {}
        (outputs / case).mkdir(parents=True, exist_ok=True)
        for name in set(found) & set(request["outputs"]):
            np.save(outputs / case / f"{name}.npy", np.array(found[name], order="C"))


if __name__ == "__main__":
    torch.set_num_threads(1)
    main(*map(Path, sys.argv[1:3]))
