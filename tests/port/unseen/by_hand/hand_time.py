"""Time in the port by hand: (1) to (4), (B1), (B13), (B16), forward and reverse."""

import numpy as np

Y00 = 1 / np.sqrt(4 * np.pi)


# ---- (1) dictionary ----


def frequencies(i, s):
    n, low, high = s["count"], s["low"], s["high"]
    omega = low * (high / low) ** (np.arange(n) / max(n - 1, 1))
    if n > 1:
        omega[-1] = high
    return {"omega": omega}


def sine_and_cosine(turns):
    """Of 2 pi times the turns; whole and quarter turns are exact."""
    rest = turns - np.round(turns)
    quarter = np.round(4 * rest)
    angle = 2 * np.pi * (rest - quarter / 4)
    sin, cos = np.sin(angle), np.cos(angle)
    q = quarter.astype(int) % 4
    sine = np.where(q == 0, sin, np.where(q == 1, cos, np.where(q == 2, -sin, -cos)))
    cosine = np.where(q == 0, cos, np.where(q == 1, -sin, np.where(q == 2, -cos, sin)))
    return sine, cosine


def atoms_at(t, omega):
    return np.concatenate(sine_and_cosine(omega * t))


def dictionary(i, s):
    t, omega = i["t"], i["omega"]
    n = len(omega)
    phi = atoms_at(t, omega)
    d_turn = 2 * np.pi * (i["d_phi"][:n] * phi[n:] - i["d_phi"][n:] * phi[:n])
    return {"phi": phi, "d_t": (omega * d_turn).sum(), "d_omega": t * d_turn}


def atom_statistics(times, omega):
    phi = np.array([atoms_at(t, omega) for t in np.unique(times)])
    mean = phi.mean(0)
    rms = np.sqrt(((phi - mean) ** 2).mean(0))
    dead = rms < 1e-6
    return mean, np.where(dead, 0, rms), dead


def atoms(i, s):
    mean, rms, dead = atom_statistics(i["times"][i["train_index"]], i["omega"])
    divisor = np.where(dead, 1, rms)
    phi_bar = np.where(dead, 0, (i["phi"] - mean) / divisor)
    d_phi = np.where(dead, 0, i["d_phi_bar"] / divisor)
    return {"mean": mean, "rms": rms, "dead": dead, "phi_bar": phi_bar, "d_phi": d_phi}


# ---- (2) colour residual ----


def residual_of(coefficients, phi_bar, beta):
    x = np.einsum("cki,k->ci", coefficients, phi_bar)
    return x, beta / Y00 * np.tanh(x)


def appearance(i, s):
    coefficients, phi_bar = i["appearance_coefficients"], i["phi_bar"]
    x, residual = residual_of(coefficients, phi_bar, s["beta"])
    e = np.exp(-2 * np.abs(x))
    slope = 4 * e / (1 + e) ** 2
    d_x = s["beta"] / Y00 * slope * i["d_residual"]
    d_coefficients = d_x[:, None, :] * phi_bar[:, None]
    d_phi_bar = np.einsum("ci,cki->k", d_x, coefficients)
    return {"residual": residual, "d_appearance_coefficients": d_coefficients, "d_phi_bar": d_phi_bar}


# ---- (3) translation residual ----


def motion(i, s):
    c, phi, g = i["motion_coefficients"], i["phi"], i["d_translation"]
    translation = np.einsum("dki,k->di", c, phi)
    d_c = g[:, None, :] * phi[None, :, None]
    d_phi = np.einsum("di,dki->k", g, c)
    return {"translation": translation, "d_motion_coefficients": d_c, "d_phi": d_phi}


# ---- (4) Matern penalty ----


def matern(i, s):
    length, c = s["correlation_length"], i["motion_coefficients"]
    w = 2 * np.pi * i["omega"]
    rho = ((5 + (length * w) ** 2) / (5 + (length * w.max()) ** 2)) ** 3
    rho = rho / rho.mean()
    both = np.concatenate([rho, rho])[:, None]
    f, n = len(w), c.shape[2]
    penalty = (both * c**2).sum() / (6 * n * f)
    d_c = both * c / (3 * n * f) * i["d_penalty"]
    return {"rho": rho, "penalty": penalty, "d_motion_coefficients": d_c}


# ---- (B1) deformation ----


def deformation(i, s):
    w, theta, sigma, g = i["fdm_weight"], i["fdm_centre"], i["fdm_width"], i["d_offsets"][:, None, :]
    delta = i["t"] - theta
    square = sigma**2 + 1e-4
    if s["basis"] == "quartic":
        u = delta**2 / square
        e = np.where(u**2 > 60 * np.log(2), 0, np.exp(-(u**2)))
        d_theta = 4 * w * e * u * delta / square * g
        d_sigma = 4 * w * e * u**2 * sigma / square * g
    else:
        half = delta**2 / (2 * square)
        e = np.where(half > 60 * np.log(2), 0, np.exp(-half))
        d_theta = w * e * delta / square * g
        d_sigma = w * e * delta**2 * sigma / square**2 * g
    return {
        "offsets": (w * e).sum(1),
        "d_fdm_weight": e * g,
        "d_fdm_centre": d_theta,
        "d_fdm_width": d_sigma,
        "d_t": -d_theta.sum(),
    }


def scene(i, s):
    model, t = s["model"], s["t"]
    omega = frequencies(
        {}, {"count": model["frequencies"], "low": model["frequency_min"], "high": model["frequency_max"]}
    )["omega"]
    phi = atoms_at(t, omega)
    mean, rms, dead = atom_statistics(i["times"][i["train_index"]], omega)
    phi_bar = np.where(dead, 0, (phi - mean) / np.where(dead, 1, rms))
    none = np.zeros((10, i["position"].shape[1]))
    offsets = deformation(i | {"t": t, "d_offsets": none}, model)["offsets"]
    shift = np.einsum("dki,k->di", i["motion_coefficients"], phi)
    return {
        "position_at_t": i["position"] + offsets[:3] + shift,
        "quaternion_at_t": i["quaternion"] + offsets[3:7],
        "log_scale_at_t": i["log_scale"] + offsets[7:10],
        "residual_at_t": residual_of(i["appearance_coefficients"], phi_bar, model["beta"])[1],
    }


# ---- (B13) exposure ----


def exposure(i, s):
    gain = np.exp(i["log_gain"])[:, None, None]
    exposed = gain * i["colour"] + i["bias"][:, None, None]
    g = i["d_exposed"]
    d_gain = (g * i["colour"]).sum((1, 2))
    return {
        "exposed": exposed,
        "d_colour": gain * g,
        "d_log_gain": np.exp(i["log_gain"]) * d_gain,
        "d_bias": g.sum((1, 2)),
    }


# ---- (B16) pose ----


def cross_matrix(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def pose_factors(r):
    """alpha, beta and their slopes divided by r, from series in r^2 below 1."""
    if r < 1:
        alpha = beta = slope_a = slope_b = 0.0
        term = 1.0
        for n in range(14):
            alpha += term / factorial(2 * n + 1)
            beta += term / factorial(2 * n + 2)
            slope_a -= 2 * (n + 1) * term / factorial(2 * n + 3)
            slope_b -= 2 * (n + 1) * term / factorial(2 * n + 4)
            term *= -r * r
        return alpha, beta, slope_a, slope_b
    alpha, beta = np.sin(r) / r, (1 - np.cos(r)) / r**2
    return alpha, beta, (np.cos(r) - alpha) / r**2, (alpha - 2 * beta) / r**2


def factorial(n):
    return float(np.prod(np.arange(1, n + 1, dtype=float)))


def pose(i, s):
    v, w, d = i["rotation_vector"], i["rotation"], i["translation"]
    k = cross_matrix(v)
    alpha, beta, slope_a, slope_b = pose_factors(np.sqrt((v**2).sum()))
    e = np.eye(3) + alpha * k + beta * k @ k
    g_w, g_d = i["d_corrected_rotation"], i["d_corrected_translation"]
    g = g_w @ w.T + np.outer(g_d, d)
    inner = alpha * g + beta * (g @ k.T + k.T @ g)
    radial = (g * (slope_a * k + slope_b * k @ k)).sum()
    d_v = np.array([(inner * cross_matrix(axis)).sum() for axis in np.eye(3)]) + v * radial
    return {
        "corrected_rotation": e @ w,
        "corrected_translation": e @ d + i["offset"],
        "d_rotation": e.T @ g_w,
        "d_translation": e.T @ g_d,
        "d_rotation_vector": d_v,
        "d_offset": g_d,
    }
