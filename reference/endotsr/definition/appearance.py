"""Equation (2): the bounded colour residual of component A."""

from collections import namedtuple

import numpy as np

Y00 = np.sqrt(1 / (4 * np.pi))


AppearanceSaved = namedtuple("AppearanceSaved", "appearance_coefficients phi_bar beta")
AppearanceGrads = namedtuple("AppearanceGrads", "d_appearance_coefficients d_phi_bar")


def appearance_forward(appearance_coefficients, phi_bar, beta):
    """Equation (2): residual (3, N) = beta / Y00 tanh(A phi_bar), to be added to the degree-0 coefficient."""
    x = np.einsum("ckn,k->cn", appearance_coefficients, phi_bar)
    return beta / Y00 * np.tanh(x), AppearanceSaved(appearance_coefficients, phi_bar, beta)  # (2.1)


def appearance_reverse(d_residual, saved):
    """Reverse of (2). The kernel writes 1 / cosh^2 as 4 e / (1 + e)^2, e = exp(-2 |x|), in which nothing overflows."""
    a, phi_bar, beta = saved
    with np.errstate(over="ignore"):
        slope = beta / Y00 * (1 / np.cosh(np.einsum("ckn,k->cn", a, phi_bar))) ** 2  # (2.3)
    d_x = slope * d_residual
    return AppearanceGrads(np.einsum("cn,k->ckn", d_x, phi_bar), np.einsum("cn,ckn->k", d_x, a))  # (2.5), (2.6)
