"""Equations (2) and (3), Gaussian by Gaussian."""

import numpy as np


def linear(coefficients, atoms):
    axes, count, n = coefficients.shape
    out = np.zeros((axes, n))
    for c in range(axes):
        for i in range(n):
            for a in range(count):
                out[c, i] += coefficients[c, a, i] * atoms[a]
    return out


def colour_residual(coefficients, atoms, beta):
    return beta * np.tanh(linear(coefficients, atoms)) * 2.0 * np.sqrt(np.pi)


def linear_gradients(d_out, coefficients, atoms):
    return (
        np.einsum("ci,a->cai", d_out, atoms),
        np.einsum("ci,cai->a", d_out, coefficients),
    )


def colour_gradients(d_out, coefficients, atoms, beta):
    slope = beta / np.cosh(linear(coefficients, atoms)) ** 2 * 2.0 * np.sqrt(np.pi)
    return linear_gradients(d_out * slope, coefficients, atoms)
