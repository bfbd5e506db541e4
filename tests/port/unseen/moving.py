"""Time of the independent port, and what its other files share."""

import math

import numpy as np

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
