"""Equation (4) as printed, with two hundred digits, and the penalty term by term."""

import mpmath
import numpy as np
from scipy import stats


def weights(omega, length):
    with mpmath.workdps(200):
        raw = [(5 / mpmath.mpf(length) ** 2 + (2 * mpmath.pi * mpmath.mpf(float(w))) ** 2) ** 3 for w in omega]
        mean = mpmath.fsum(raw) / len(raw)
        return [r / mean for r in raw]


def weights_by_student(omega, length):
    """The spectral density of Matern-5/2 is a Student-t density with 5 degrees of freedom and scale 1/l."""
    raw = 1.0 / stats.t.pdf(2 * np.pi * np.asarray(omega), df=5, scale=1.0 / length)
    return raw / raw.mean()


def penalty(coefficients, rho):
    axes, atoms, n = coefficients.shape
    count = atoms // 2
    total = 0.0
    for i in range(n):
        for f in range(count):
            for axis in range(axes):
                total += rho[f] * (coefficients[axis, f, i] ** 2 + coefficients[axis, count + f, i] ** 2)
    return total / (6 * n * count)


def penalty_gradient(coefficients, rho):
    n, count = coefficients.shape[2], coefficients.shape[1] // 2
    return np.concatenate([rho, rho])[None, :, None] * coefficients / (3 * n * count)
