"""Spherical harmonics of one Gaussian: the formulas of specification B4, each above its reverse.

Scalars in, tuples out; `harmonics` applies them to all Gaussians. Y_0 is the constant Y00.
"""

import math

from endotsr.method.kernels.jit import jit_formula

C1 = 0.4886025119029199
C2A, C2B, C2C = 1.0925484305920792, 0.31539156525252005, 0.5462742152960396
C3A, C3B, C3C = 0.5900435899266435, 2.890611442640554, 0.4570457994644658
C3D, C3E = 0.3731763325901154, 1.445305721320277


@jit_formula
def direction(position, centre):
    """The unit vector n from the camera centre to the Gaussian and 1/distance; all zero for a Gaussian there."""
    x, y, z = position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]
    distance = math.sqrt(x * x + y * y + z * z)
    zero, one = type(distance)(0), type(distance)(1)
    inverse = one / distance if distance > zero else zero
    return x * inverse, y * inverse, z * inverse, inverse


@jit_formula
def direction_reverse(x, y, z, inverse, d_direction):
    """Gradient of the position, from dL/dn: the component along n is removed, the rest divided by the distance."""
    g_x, g_y, g_z = d_direction
    along = g_x * x + g_y * y + g_z * z
    return (g_x - along * x) * inverse, (g_y - along * y) * inverse, (g_z - along * z) * inverse


@jit_formula
def harmonic_basis(x, y, z):
    """Y_1 ... Y_15 of a unit vector."""
    real = type(x)
    c1, c2a, c2b, c2c = real(C1), real(C2A), real(C2B), real(C2C)
    c3a, c3b, c3c, c3d, c3e = real(C3A), real(C3B), real(C3C), real(C3D), real(C3E)
    two, three, four = real(2), real(3), real(4)
    xx, yy, zz = x * x, y * y, z * z
    return (
        -c1 * y,
        c1 * z,
        -c1 * x,
        c2a * x * y,  # Y_4
        -c2a * y * z,
        c2b * (two * zz - xx - yy),
        -c2a * x * z,
        c2c * (xx - yy),
        -c3a * y * (three * xx - yy),  # Y_9
        c3b * x * y * z,
        -c3c * y * (four * zz - xx - yy),
        c3d * z * (two * zz - three * xx - three * yy),
        -c3c * x * (four * zz - xx - yy),
        c3e * z * (xx - yy),
        -c3a * x * (xx - three * yy),
    )


@jit_formula
def harmonic_basis_reverse(degree, x, y, z, d_basis):
    """Gradients of independent x, y, z, from the gradients of Y_1 ... Y_15 up to the active degree, 1 to 3."""
    real = type(x)
    c1, c2a, c2b, c2c = real(C1), real(C2A), real(C2B), real(C2C)
    c3a, c3b, c3c, c3d, c3e = real(C3A), real(C3B), real(C3C), real(C3D), real(C3E)
    two, three, four, six, eight = real(2), real(3), real(4), real(6), real(8)
    g1, g2, g3, g4, g5, g6, g7, g8, g9, g10, g11, g12, g13, g14, g15 = d_basis
    xx, yy, zz = x * x, y * y, z * z
    g_x, g_y, g_z = -c1 * g3, -c1 * g1, c1 * g2
    x2 = c2a * (y * g4 - z * g7) - two * c2b * x * g6 + two * c2c * x * g8
    y2 = c2a * (x * g4 - z * g5) - two * c2b * y * g6 - two * c2c * y * g8
    z2 = -c2a * (y * g5 + x * g7) + four * c2b * z * g6
    if degree > 1:
        g_x, g_y, g_z = g_x + x2, g_y + y2, g_z + z2
    x3 = -c3a * six * x * y * g9 + c3b * y * z * g10 + c3c * two * x * y * g11 - c3d * six * x * z * g12
    x3 += -c3c * (four * zz - three * xx - yy) * g13 + c3e * two * x * z * g14 - c3a * three * (xx - yy) * g15
    y3 = -c3a * three * (xx - yy) * g9 + c3b * x * z * g10 - c3c * (four * zz - xx - three * yy) * g11
    y3 += -c3d * six * y * z * g12 + c3c * two * x * y * g13 - c3e * two * y * z * g14 + c3a * six * x * y * g15
    z3 = c3b * x * y * g10 - c3c * eight * y * z * g11 + c3d * (six * zz - three * xx - three * yy) * g12
    z3 += -c3c * eight * x * z * g13 + c3e * (xx - yy) * g14
    if degree > 2:
        g_x, g_y, g_z = g_x + x3, g_y + y3, g_z + z3
    return g_x, g_y, g_z
