"""Equation (4): Matern-5/2 weights of the frequencies, and the penalty on motion that they weight."""

from collections import namedtuple

import numpy as np

MaternSaved = namedtuple("MaternSaved", "motion_coefficients rho")


def matern_weights(omega, length):
    """Equation (4), upper line: rho (F,), mean 1, for frequencies (F,) > 0 and the correlation length >= 0, as printed.

    The kernel first divides by the largest frequency, which avoids overflow. At 1e-40 every rho rounds to 1 already.
    """
    rho = (5 / max(length, 1e-40) ** 2 + (2 * np.pi * omega) ** 2) ** 3  # (5.2)
    return rho / rho.mean()  # (5.3)


def matern_penalty_forward(motion_coefficients, rho):
    """Equation (4), lower line: scene units squared; both atoms of a frequency share its weight."""
    n = motion_coefficients.shape[2]
    squares = np.einsum("dkn,dkn->k", motion_coefficients, motion_coefficients)
    return np.tile(rho, 2) @ squares / (6 * max(n, 1) * rho.size), MaternSaved(motion_coefficients, rho)  # (5.4)


def matern_penalty_reverse(d_penalty, saved):
    """Reverse of (4): d_motion_coefficients (3, 2F, N); rho is held fixed."""
    c, rho = saved
    return d_penalty * np.tile(rho, 2)[:, None] * c / (3 * max(c.shape[2], 1) * rho.size)  # (5.7)
