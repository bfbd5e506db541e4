"""Equation (B4): colour from real spherical harmonics of degree 0 to 3."""

from collections import namedtuple

import numpy as np

from endotsr.definition.appearance import Y00

C1, C2A, C2B, C2C = (np.sqrt(n / (d * np.pi)) for n, d in ((3, 4), (15, 4), (5, 16), (15, 16)))
C3A, C3B, C3C, C3D, C3E = (np.sqrt(n / (d * np.pi)) for n, d in ((35, 32), (105, 4), (21, 32), (7, 16), (105, 16)))

# Y_k as a polynomial: a factor, then the coefficient and exponents of x, y, z of each monomial. The kernel is unrolled.
POLYNOMIALS = [
    (Y00, [(1, 0, 0, 0)]),
    (-C1, [(1, 0, 1, 0)]),
    (C1, [(1, 0, 0, 1)]),
    (-C1, [(1, 1, 0, 0)]),
    (C2A, [(1, 1, 1, 0)]),
    (-C2A, [(1, 0, 1, 1)]),
    (C2B, [(2, 0, 0, 2), (-1, 2, 0, 0), (-1, 0, 2, 0)]),
    (-C2A, [(1, 1, 0, 1)]),
    (C2C, [(1, 2, 0, 0), (-1, 0, 2, 0)]),
    (-C3A, [(3, 2, 1, 0), (-1, 0, 3, 0)]),
    (C3B, [(1, 1, 1, 1)]),
    (-C3C, [(4, 0, 1, 2), (-1, 2, 1, 0), (-1, 0, 3, 0)]),
    (C3D, [(2, 0, 0, 3), (-3, 2, 0, 1), (-3, 0, 2, 1)]),
    (-C3C, [(4, 1, 0, 2), (-1, 3, 0, 0), (-1, 1, 2, 0)]),
    (C3E, [(1, 2, 0, 1), (-1, 0, 2, 1)]),
    (-C3A, [(1, 3, 0, 0), (-3, 1, 2, 0)]),
]


HarmonicsSaved = namedtuple("HarmonicsSaved", "harmonics residual position centre degree clamped")
HarmonicsGrads = namedtuple("HarmonicsGrads", "d_harmonics d_residual d_position d_centre")


def basis(direction, terms):
    """Y_k (terms, N) of directions (3, N)."""
    x, y, z = direction
    return np.array([f * sum(c * x**i * y**j * z**k for c, i, j, k in p) for f, p in POLYNOMIALS[:terms]])


def basis_slopes(direction, terms):
    """dY_k / d(x, y, z), (terms, 3, N), for independent x, y, z."""
    out = np.zeros((terms, *direction.shape), direction.dtype)
    for row, (factor, polynomial) in enumerate(POLYNOMIALS[:terms]):
        for c, *powers in polynomial:
            for axis in np.flatnonzero(powers):
                x, y, z = (d ** (p - (axis == i)) for i, (d, p) in enumerate(zip(direction, powers)))
                out[row, axis] += factor * c * powers[axis] * x * y * z  # (8.4)
    return out


def directions(position, centre):
    """Unit vectors (3, N) from the optical centre, and 1 / distance (N,); both 0 at the centre itself."""
    v = position - centre[:, None]
    length = np.sqrt((v * v).sum(axis=0))
    inverse = np.where(length == 0, 0, 1 / np.where(length == 0, 1, length))
    return v * inverse, inverse


def harmonics_forward(harmonics, residual, position, centre, degree):
    """Equation (B4): display colour (3, N), clamped to at least 0.

    From coefficients (K, 3, N), K >= (degree + 1)^2, residual (3, N) or None, positions (3, N) and the centre (3,).
    """
    terms = (degree + 1) ** 2
    y = basis(directions(position, centre)[0], terms)
    colour = 0.5 + np.einsum("kn,kcn->cn", y, harmonics[:terms]) + (0 if residual is None else Y00 * residual)
    saved = HarmonicsSaved(harmonics, residual, position, centre, degree, colour.real < 0)
    return np.where(colour.real < 0, 0, colour), saved


def harmonics_reverse(d_colour, saved):
    """Reverse of (B4): through the coefficients and through the viewing direction."""
    harmonics, residual, position, centre, degree, clamped = saved
    terms = (degree + 1) ** 2
    g = np.where(clamped, 0, d_colour)  # ruling "harmonics": gradient 0 where below 0; (8.1)
    n, inverse = directions(position, centre)
    d_harmonics = np.zeros_like(harmonics)
    d_harmonics[:terms] = np.einsum("kn,cn->kcn", basis(n, terms), g)  # (8.2)
    d_n = np.einsum("cn,kcn,kan->an", g, harmonics[:terms], basis_slopes(n, terms))  # (8.3)
    d_v = (d_n - (n * d_n).sum(axis=0) * n) * inverse  # (8.5)
    return HarmonicsGrads(d_harmonics, None if residual is None else Y00 * g, d_v, -d_v.sum(axis=1))  # (8.6)
