"""Oracle of equation (B1): the formula with loops, plain NumPy, any float dtype (complex too, for complex steps)."""

import numpy as np


def basis_value(t, centre, width, basis):
    """One basis function of time."""
    spread = width**2 + 1e-4
    if basis == "quartic":
        return np.exp(-(((t - centre) ** 2 / spread) ** 2))
    return np.exp(-((t - centre) ** 2) / (2 * spread))


def offsets(weight, centre, width, t, basis):
    """psi (10, N)."""
    channels, bases, count = weight.shape
    out = np.zeros((channels, count), np.result_type(weight, centre, width, np.asarray(t)))
    for c in range(channels):
        for j in range(bases):
            for i in range(count):
                out[c, i] += weight[c, j, i] * basis_value(t, centre[c, j, i], width[c, j, i], basis)
    return out


def derivative(weight, centre, width, t, basis, d_offsets, wanted, step=1e-40):
    """Gradient of <d_offsets, psi> by one of weight, centre, width, entry by entry, by complex steps."""
    inputs = {"weight": weight, "centre": centre, "width": width}
    gradient = np.zeros_like(weight)
    for index in np.ndindex(weight.shape):
        shifted = {name: a.astype(complex) for name, a in inputs.items()}
        shifted[wanted][index] += 1j * step
        psi = offsets(**shifted, t=t, basis=basis)
        gradient[index] = (d_offsets * psi.imag).sum() / step
    return gradient


def derivative_by_time(weight, centre, width, t, basis, d_offsets, step=1e-40):
    """Gradient of <d_offsets, psi> by t, by a complex step."""
    return (d_offsets * offsets(weight, centre, width, t + 1j * step, basis).imag).sum() / step
