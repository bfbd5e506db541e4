"""Where a case says that its truth is an oracle, the oracle is asked and must give the value."""

import numpy as np
import pytest

from endotsr.golden.judge.compare import judged
from endotsr.golden.judge.store import golden_folder, read_golden
from oracle import (
    adam,
    calibration_oracle,
    deformation,
    exposure_oracle,
    fitting_oracle,
    fourier_oracle,
    laplacian_oracle,
    losses,
    matern_oracle,
    pose_oracle,
    residuals_oracle,
    splatting_oracle,
)

GOLDEN = read_golden(golden_folder())


def floats(values):
    return np.array([float(v) for v in values])


def frequencies(i, s, right):
    return {"omega": floats(fourier_oracle.frequencies(s["count"], s["low"], s["high"]))}


def dictionary(i, s, right):
    return {"phi": floats(fourier_oracle.dictionary(float(i["t"]), i["omega"]))}


def atoms(i, s, right):
    """The oracle normalises phi(t) for a time; two times give mean and gain of every atom."""
    times = sorted(set(i["times"][i["train_index"]]))
    gains, means = [], []
    for k in range(i["phi"].size):
        (t0, t1) = (0.1, 0.23)
        a, b = (fourier_oracle.normalised(times, i["omega"], t)[k] for t in (t0, t1))
        p, q = (float(fourier_oracle.dictionary(t, i["omega"])[k]) for t in (t0, t1))
        gains.append(0.0 if a is None or b is None else (a - b) / (p - q))
        means.append(0.0 if a is None or gains[-1] == 0 else p - a / gains[-1])
    return {"phi_bar": (i["phi"] - np.array(means)) * np.array(gains)}


def appearance(i, s, right):
    a, atoms_now = i["appearance_coefficients"], i["phi_bar"]
    d_a, d_phi = residuals_oracle.colour_gradients(i["d_residual"], a, atoms_now, s["beta"])
    residual = residuals_oracle.colour_residual(a, atoms_now, s["beta"])
    return {"residual": residual, "d_appearance_coefficients": d_a, "d_phi_bar": d_phi}


def motion(i, s, right):
    c, phi = i["motion_coefficients"], i["phi"]
    d_c, d_phi = residuals_oracle.linear_gradients(i["d_translation"], c, phi)
    return {"translation": residuals_oracle.linear(c, phi), "d_motion_coefficients": d_c, "d_phi": d_phi}


def matern(i, s, right):
    length, omega, c = s["correlation_length"], i["omega"], i["motion_coefficients"]
    rho = np.ones(omega.size) if length == 0 else floats(matern_oracle.weights(omega, length))
    gradient = float(i["d_penalty"]) * matern_oracle.penalty_gradient(c, rho)
    return {"rho": rho, "penalty": matern_oracle.penalty(c, rho), "d_motion_coefficients": gradient}


def laplacian(i, s, right):
    rule, levels = s["upsampling"], s["levels"]
    bands, _ = laplacian_oracle.pyramid(i["observed"], rule, levels)
    masks = laplacian_oracle.masks_by_impulse_response(i["mask"], rule, levels)
    found = {f"band_{k + 1}": band for k, band in enumerate(bands)}
    found |= {f"valid_{k + 1}": valid for k, valid in enumerate(masks)}
    images = [np.where(i["mask"], i[name], 0.0) for name in ("rendered", "observed")]  # excluded values are never read
    gradient = laplacian_oracle.loss_gradient(*images, masks, rule)
    loss = laplacian_oracle.loss(*images, masks, rule)
    return found | {"loss": loss, "d_rendered": float(i["d_loss"]) * gradient}


def calibration(i, s, right):
    pairs = [(np.sqrt((a**2).mean()), np.sqrt((b**2).mean())) for a, b in zip(i["d_photometric"], i["d_laplacian"])]
    return {"lambda_lap": calibration_oracle.view_median_weight([p for p in pairs if p[0] > 0], s["gradient_ratio"])}


def deformation_case(i, s, right):
    arrays = (i["fdm_weight"], i["fdm_centre"], i["fdm_width"], float(i["t"]), s["basis"])
    found = {"offsets": deformation.offsets(*arrays)}
    for name in ("weight", "centre", "width"):
        found[f"d_fdm_{name}"] = deformation.derivative(*arrays, i["d_offsets"], name)
    return found | {"d_t": deformation.derivative_by_time(*arrays, i["d_offsets"])}


def adam_case(i, s, right):
    out = np.empty_like(i["parameter"])
    for at in np.ndindex(out.shape):
        gradients = iter([g[at] for g in i["gradients"]])
        arguments = (len(i["gradients"]), s["rate"], s["beta1"], s["beta2"], s["epsilon"])
        out[at] = adam.adam_scalar(i["parameter"][at], lambda p, g=gradients: next(g), *arguments)[-1]
    return {"parameter_after": out}


def masked_l1(i, s, right):
    return {"loss": losses.masked_l1(i["rendered"], i["observed"], i["mask"])}


def masked_ssim(i, s, right):
    arrays = i["rendered"], i["observed"], i["mask"]
    gradient = losses.masked_ssim_gradient(*arrays) if i["mask"].any() else 0 * i["rendered"]
    return {"ssim": losses.masked_ssim(*arrays), "d_rendered": float(i["d_ssim"]) * gradient}


def normalised_depth(i, s, right):
    loss, gradient = losses.normalised_depth(i["rendered_depth"], i["prior_depth"], i["mask"])
    return {"loss": loss, "d_rendered_depth": float(i["d_loss"]) * gradient}


def exposure(i, s, right):
    arrays = i["colour"], i["log_gain"]
    gradients = exposure_oracle.gradients(*arrays, i["d_exposed"])
    named = dict(zip(("d_colour", "d_log_gain", "d_bias"), gradients, strict=True))
    return {"exposed": exposure_oracle.exposed(*arrays, i["bias"])} | named


def pose(i, s, right):
    given = [i[name] for name in ("rotation", "translation", "rotation_vector", "offset")]
    gradients = pose_oracle.gradients(*given, i["d_corrected_rotation"], i["d_corrected_translation"])
    names = ("d_rotation", "d_translation", "d_rotation_vector", "d_offset")
    found = dict(zip(("corrected_rotation", "corrected_translation"), pose_oracle.corrected(*given), strict=True))
    return found | dict(zip(names, gradients, strict=True))


def smoothness(i, s, right):
    arrays = i["rendered_depth"], i["rendered"], i["mask"], i["edges"]
    loss, d_depth, d_image = losses.smoothness(*arrays, s["total_variation_factor"])
    up = float(i["d_loss"])
    return {"loss": loss, "d_rendered": up * d_image, "d_rendered_depth": up * d_depth}


def covariance(i, s, right):
    return {"rotation": splatting_oracle.rotation(i["quaternion"])}


def lens_of(s):
    return tuple(s["camera"][name] for name in ("fx", "fy", "cx", "cy", "width", "height"))


def projection(i, s, right):
    sigma = np.einsum("ikn,kn,jkn->ijn", i["rotation"], i["scale"] ** 2, i["rotation"])
    pose = (i["rotation_matrix"], i["translation"])
    u, v, a, b, c, z = splatting_oracle.project(i["position"], sigma, pose, lens_of(s), s["raster"])
    seen = z > s["raster"]["near"]
    mean, cover = np.where(seen, [u, v], 0), np.where(seen, [a, b, c], 0)
    return {"mean2d": mean, "covariance2d": cover, "depth": np.where(seen, z, 0)}


def harmonics(i, s, right):
    arrays = i["harmonics"], i["residual"], i["position"], i["centre"], s["degree"]
    return {"colour": splatting_oracle.colour(*arrays)}


def composite(i, s, right):
    rules, size = s["raster"], (s["width"], s["height"])
    u, v = i["mean2d"]
    a, b, c = i["covariance2d"]
    screen = u, v, a, b, c, i["depth"], splatting_oracle.sigmoid(i["opacity_logit"]), np.ones(u.size, bool)
    colour, depth, opacity, _ = splatting_oracle.composite(*screen, i["colour"], i["background"], *size, rules)
    images = {"colour_image": colour, "depth_image": depth, "opacity_image": opacity}
    given = i["d_colour_image"], i["d_depth_image"], i["d_opacity_image"]
    off = rules["deviations"]
    back = splatting_oracle.composite_reverse(
        *given, *screen, i["colour"], i["background"], *size, rules, off["pass_clamped_alpha"]
    )
    if off["drop_depth_to_z"]:
        back["depth"] = 0 * back["depth"]
    if off["conic_epsilon"]:
        square = (a * c - b * b) ** 2
        back["covariance2d"] = back["covariance2d"] * square / (square + 1e-7)
    return images | {f"d_{name}": value for name, value in back.items()}


def render(i, s, right):
    """In long doubles: the oracle forms Sigma and a c - b^2, where a needle loses digits."""
    pose = (i["rotation_matrix"], i["translation"])
    wide = {name: array.astype(np.longdouble) for name, array in i.items()}
    images = splatting_oracle.render(wide, pose, lens_of(s), s["raster"], i["background"], s["degree"])
    return dict(zip(("colour_image", "depth_image", "opacity_image"), images))


def scene(i, s, right):
    """Offsets, C phi and the colour residual at time t, each by its own oracle."""
    m, t = s["model"], s["t"]
    omega = floats(fourier_oracle.frequencies(m["frequencies"], m["frequency_min"], m["frequency_max"]))
    names = "position", "quaternion", "log_scale"
    now = {name: i[name] for name in names}
    if "fdm_weight" in i:
        psi = deformation.offsets(i["fdm_weight"], i["fdm_centre"], i["fdm_width"], t, m["basis"])
        now = {name: i[name] + part for name, part in zip(names, (psi[:3], psi[3:7], psi[7:]))}
    if "motion_coefficients" in i:
        phi = floats(fourier_oracle.dictionary(t, omega))
        now["position"] = now["position"] + residuals_oracle.linear(i["motion_coefficients"], phi)
    residual = None
    if "appearance_coefficients" in i:
        found = fourier_oracle.normalised(i["times"][i["train_index"]], omega, t)
        phi_bar = np.array([0.0 if v is None else v for v in found])
        residual = residuals_oracle.colour_residual(i["appearance_coefficients"], phi_bar, m["beta"])
    return {f"{name}_at_t": value for name, value in (now | {"residual": residual}).items()}


def objective(i, s, right):
    """The whole of equation (6), forward."""
    w, m = s["loss"], s["model"]
    at_t = {name.removesuffix("_at_t"): value for name, value in scene(i, s, right).items()}
    pose, black = (i["rotation_matrix"], i["translation"]), np.zeros(3)
    images = splatting_oracle.render(i | at_t, pose, lens_of(s), s["raster"], black, s["degree"])
    colour, depth = images[:2]
    mask, observed = i["mask"], i["observed"]
    masks = laplacian_oracle.masks_by_impulse_response(mask, w["upsampling"])
    terms = {
        "l1": losses.masked_l1(colour, observed, mask),
        "ssim": losses.masked_ssim(colour, observed, mask),
        "depth": losses.normalised_depth(depth, i["prior_depth"], mask)[0],
        "smoothness": losses.smoothness(depth, colour, mask, i["edges"], w["total_variation_factor"])[0],
        "laplacian": laplacian_oracle.loss(colour, observed, masks, w["upsampling"]),
    }
    total = (1 - w["ssim_weight"]) * terms["l1"] + w["ssim_weight"] * (1 - terms["ssim"])
    total += w["depth_weight"] * terms["depth"] + w["smoothness_weight"] * terms["smoothness"]
    total += w["lambda_lap"] * terms["laplacian"]
    if "motion_coefficients" in i:
        omega = fourier_oracle.frequencies(m["frequencies"], m["frequency_min"], m["frequency_max"])
        rho = floats(matern_oracle.weights(omega, m["correlation_length"]))
        terms["penalty"] = matern_oracle.penalty(i["motion_coefficients"], rho)
        total += w["lambda_msp"] * terms["penalty"]
    named = {f"term_{name}": value for name, value in terms.items()}
    return named | {"colour_image": colour, "depth_image": depth, "objective": total}


def schedule(i, s, right):
    rows = [fitting_oracle.schedule(int(k), s["config"]) for k in i["iteration"]]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def density(i, s, right):
    return fitting_oracle.density(i, s)


def initialisation(i, s, right):
    return fitting_oracle.initialisation(i, s)


ORACLES = {
    "frequencies": frequencies, "dictionary": dictionary, "atoms": atoms, "appearance": appearance, "motion": motion,
    "matern": matern, "laplacian": laplacian, "calibration": calibration, "deformation": deformation_case,
    "adam": adam_case, "masked_l1": masked_l1, "masked_ssim": masked_ssim, "normalised_depth": normalised_depth,
    "exposure": exposure, "pose": pose,
    "smoothness": smoothness, "covariance": covariance, "projection": projection, "harmonics": harmonics,
    "composite": composite, "render": render, "scene": scene, "objective": objective,
    "schedule": schedule, "density": density, "initialisation": initialisation,
}  # fmt: skip
CASES = [c for c in GOLDEN.cases if any(o.truth.kind == "oracle" for o in c.outputs.values())]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_the_oracle_gives_the_expected_value(case):
    inputs = {name: GOLDEN.array(case, a.file) for name, a in case.inputs.items()}
    expected = {name: GOLDEN.array(case, o.file) for name, o in case.outputs.items()}
    with np.errstate(all="ignore"):
        found = ORACLES[case.operation](inputs, case.settings, expected)
    asked = {name: output for name, output in case.outputs.items() if output.truth.kind == "oracle"}
    assert {name: np.shape(found[name]) for name in asked} == {name: output.shape for name, output in asked.items()}
    failed = []
    for answer in range(case.answers):
        right = {name: GOLDEN.array(case, output.answer(answer)) for name, output in asked.items()}
        verdicts = {n: judged(np.asarray(found[n]), right[n], o.compare, "float64") for n, o in asked.items()}
        failed.append({name: verdict for name, verdict in verdicts.items() if not verdict.passed})
    assert {} in failed, failed


def test_every_named_oracle_exists():
    modules = {
        m.__name__.rsplit(".", 1)[-1]: m
        for m in (adam, calibration_oracle, deformation, exposure_oracle, fitting_oracle, fourier_oracle,
                  laplacian_oracle, losses, matern_oracle, pose_oracle, residuals_oracle, splatting_oracle)
    }  # fmt: skip
    for case in GOLDEN.cases:
        for output in case.outputs.values():
            if output.truth.kind == "oracle":
                module, function = output.truth.oracle.split(".")
                assert hasattr(modules[module], function), output.truth.oracle


def test_most_values_up_to_level_2_have_an_oracle():
    outputs = [o for c in GOLDEN.cases for o in c.outputs.values() if o.level in (1, 2)]
    assert sum(o.truth.kind == "oracle" for o in outputs) > 0.6 * len(outputs)
