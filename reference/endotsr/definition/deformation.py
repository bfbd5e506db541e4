"""Equation (B1): the flexible deformation model, ten curves over time for each Gaussian."""

from collections import namedtuple

import numpy as np

DeformationSaved = namedtuple("DeformationSaved", "weight centre width t basis")
DeformationGrads = namedtuple("DeformationGrads", "d_fdm_weight d_fdm_centre d_fdm_width d_t")


def bell(centre, width, t, basis):
    """Delta, Sigma and the basis value, (10, B, N) each; a value below 2^-60 is 0.

    Ruling "FDM basis": Deform3DGS squares Delta^2 / Sigma where a Gaussian would halve it. The quartic bell
    is flatter at its centre and ends sooner, so that a basis acts on a shorter stretch of time.
    """
    delta = t - centre
    sigma = width**2 + 1e-4
    exponent = (delta**2 / sigma) ** 2 if basis == "quartic" else delta**2 / (2 * sigma)
    live = exponent.real <= 60 * np.log(2)
    return delta, sigma, np.where(live, np.exp(-np.where(live, exponent, 0)), 0)


def deformation_forward(fdm_weight, fdm_centre, fdm_width, t, basis="quartic"):
    """Equation (B1): offsets psi (10, N) at normalised time t."""
    _, _, e = bell(fdm_centre, fdm_width, t, basis)
    return (fdm_weight * e).sum(axis=1), DeformationSaved(fdm_weight, fdm_centre, fdm_width, t, basis)


def deformation_reverse(d_offsets, saved):
    """Reverse of (B1): from d_offsets (10, N). The kernel computes one exponential for value and derivatives."""
    w, centre, width, t, basis = saved
    delta, sigma, e = bell(centre, width, t, basis)
    d_e = w * d_offsets[:, None]  # (4.1)
    d_exponent = np.where(e == 0, 0, -d_e * e)  # (4.2)
    if basis == "quartic":
        by_delta = 4 * delta**3 / sigma**2  # (4.3)
        by_width = -4 * delta**4 * width / sigma**3  # (4.4)
    else:
        by_delta = delta / sigma  # (4.3)
        by_width = -(delta**2) * width / sigma**2  # (4.4)
    d_centre = -d_exponent * by_delta  # (4.5)
    return DeformationGrads(e * d_offsets[:, None], d_centre, d_exponent * by_width, -d_centre.sum())  # (4.6)
