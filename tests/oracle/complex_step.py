"""Derivatives of the definition by complex steps, exact to rounding: Im f(x + i h) / h."""

import numpy as np

H = 1e-40


def derivative(function, array):
    """Of a number by every entry of a real array; the function takes complex arrays and never conjugates."""
    array = np.asarray(array, float)
    out = np.zeros(array.shape)
    for index in np.ndindex(array.shape):
        moved = array.astype(complex)
        moved[index] += 1j * H
        out[index] = function(moved).imag / H
    return out
