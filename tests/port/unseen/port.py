"""A port in NumPy written from docs/specification alone, whose every choice can be replaced by a wrong one.

`port(operation, inputs, settings, wrong)` gives the outputs of a golden case. `wrong` holds the replaced choices by
name; what it does not hold is right. Only forward formulas are written. A gradient is a complex step of the forward
formula: the imaginary part after a step of 1e-50 along the imaginary axis is the derivative to the last digit. So a
wrong choice in a formula reaches value and gradient together, and `wrong["forward"]` and `wrong["reverse"]` restrict
it to one of them.
"""

import numpy as np
from decisions import adam, calibration, density, initialisation, schedule
from losses import laplacian, masked_l1, masked_ssim, normalised_depth, smoothness
from moving import (
    Choices,
    appearance,
    atoms,
    deformation,
    dictionary,
    exposure,
    frequencies,
    matern,
    motion,
    pose,
    statistics,
    waves,
)
from screen import blended, composite, covariance, harmonics, projected, projection

STEP = 1e-50


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
