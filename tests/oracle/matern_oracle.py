"""The weights of equation (4) as printed, with two hundred digits, and as a Student-t density."""

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
