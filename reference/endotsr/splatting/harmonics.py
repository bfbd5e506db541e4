"""Colour from real spherical harmonics of degree 0 to 3, with the gradient through the view direction (B4).

colour = max(0, 1/2 + sum_k Y_k(direction) h_k), direction from the camera centre to the (deformed) Gaussian.
A colour residual is added to the degree-0 coefficient before the sum: with zero residual nothing changes, bit by bit.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.constants import Y00
from endotsr.kernels.jit import jit, jit_formula
from endotsr.kernels.sums import sum_columns
from endotsr.kernels.threads import parallel_for
from endotsr.kernels.vectors import GROUP, column, keep, keep_where, kept, local_array, write_group

FloatArray = NDArray[np.floating]

_U64 = np.uint64  # no index may count from the end

DIRECTIONS_PER_SUM = 512  # Gaussians whose gradients by the camera centre are added up together
DIRECTION, BASIS, POSITION = 4 * GROUP, 15 * GROUP, 3 * GROUP  # numbers that these take for a group

C1 = 0.4886025119029199
C2A, C2B, C2C = 1.0925484305920792, 0.31539156525252005, 0.5462742152960396
C3A, C3B, C3C = 0.5900435899266435, 2.890611442640554, 0.4570457994644658
C3D, C3E = 0.3731763325901154, 1.445305721320277


class HarmonicsSaved(NamedTuple):
    """Inputs of the forward pass and which channels were clamped at zero."""

    harmonics: FloatArray
    residual: FloatArray | None
    position: FloatArray
    centre: FloatArray
    degree: int
    clamped: NDArray[np.bool_]  # (3, N)


class HarmonicsGrads(NamedTuple):
    """Gradients of the colour stage."""

    harmonics: FloatArray  # (K, 3, N); bands above the active degree are zero
    residual: FloatArray | None  # (3, N), None when there was no residual
    position: FloatArray  # (3, N) through the view direction
    centre: FloatArray  # (3,) camera centre


# One Gaussian: the formulas of the specification, each above its reverse.


def direction(position, centre):
    """The unit vector n from the camera centre to the Gaussian and 1/distance; all zero for a Gaussian there."""
    x, y, z = position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]
    distance = math.sqrt(x * x + y * y + z * z)
    zero, one = type(distance)(0), type(distance)(1)
    inverse = one / distance if distance > zero else zero
    return x * inverse, y * inverse, z * inverse, inverse


def direction_reverse(x, y, z, inverse, d_direction):
    """By the position, from the gradient by n: the part along n is removed, the rest divided by the distance."""
    g_x, g_y, g_z = d_direction
    along = g_x * x + g_y * y + g_z * z
    return (g_x - along * x) * inverse, (g_y - along * y) * inverse, (g_z - along * z) * inverse


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


def harmonic_basis_reverse(x, y, z, d_basis):
    """By x, y, z, taken as independent, from the gradients by Y_1 ... Y_15; added up degree by degree."""
    real = type(x)
    c1, c2a, c2b, c2c = real(C1), real(C2A), real(C2B), real(C2C)
    c3a, c3b, c3c, c3d, c3e = real(C3A), real(C3B), real(C3C), real(C3D), real(C3E)
    two, three, four, six, eight = real(2), real(3), real(4), real(6), real(8)
    g1, g2, g3, g4, g5, g6, g7, g8, g9, g10, g11, g12, g13, g14, g15 = d_basis
    xx, yy, zz = x * x, y * y, z * z
    x2 = c2a * (y * g4 - z * g7) - two * c2b * x * g6 + two * c2c * x * g8
    y2 = c2a * (x * g4 - z * g5) - two * c2b * y * g6 - two * c2c * y * g8
    z2 = -c2a * (y * g5 + x * g7) + four * c2b * z * g6
    x3 = -c3a * six * x * y * g9 + c3b * y * z * g10 + c3c * two * x * y * g11 - c3d * six * x * z * g12
    x3 += -c3c * (four * zz - three * xx - yy) * g13 + c3e * two * x * z * g14 - c3a * three * (xx - yy) * g15
    y3 = -c3a * three * (xx - yy) * g9 + c3b * x * z * g10 - c3c * (four * zz - xx - three * yy) * g11
    y3 += -c3d * six * y * z * g12 + c3c * two * x * y * g13 - c3e * two * y * z * g14 + c3a * six * x * y * g15
    z3 = c3b * x * y * g10 - c3c * eight * y * z * g11 + c3d * (six * zz - three * xx - three * yy) * g12
    z3 += -c3c * eight * x * z * g13 + c3e * (xx - yy) * g14
    return -c1 * g3 + x2 + x3, -c1 * g1 + y2 + y3, c1 * g2 + z2 + z3


direction, direction_reverse = jit_formula(direction), jit_formula(direction_reverse)
harmonic_basis, harmonic_basis_reverse = jit_formula(harmonic_basis), jit_formula(harmonic_basis_reverse)


# All Gaussians: a group at a time, as vector code (`vectors`). The number of bands is known at run time only: the sum
# over the bands is a loop over the group for each of them.


def _colour(first, stop, harmonics, residual, position, centre, degree, colour, clamped):
    """`residual` has shape (3, 0) when there is none."""
    real = position.dtype.type
    y00, half, zero = real(Y00), real(0.5), real(0)
    basis, sums = local_array(BASIS, position), local_array(GROUP, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(count if degree > 0 else 0):
            x, y, z, _ = direction(column(position, 3, start + item), centre)
            keep(basis, item, harmonic_basis(x, y, z))
        for channel in range(3):
            for item in range(count):
                sums[_U64(item)] = harmonics[0, channel, _U64(start + item)]
            for item in range(count if residual.shape[1] > 0 else 0):
                sums[_U64(item)] += residual[channel, _U64(start + item)]
            for item in range(count):
                sums[_U64(item)] = half + y00 * sums[_U64(item)]
            for k in range(1, (degree + 1) * (degree + 1)):
                for item in range(count):
                    y_k = basis[_U64((k - 1) * GROUP + item)]
                    sums[_U64(item)] += y_k * harmonics[_U64(k), channel, _U64(start + item)]
            for item in range(count):
                clamped[channel, _U64(start + item)] = sums[_U64(item)] < zero
                colour[channel, _U64(start + item)] = max(sums[_U64(item)], zero)


def _colour_reverse(
    first, stop, harmonics, position, centre, degree, clamped, d_colour, d_harmonics, d_residual, d_position
):
    """`d_residual` has shape (3, 0) when there is none."""
    real = position.dtype.type
    y00, zero = real(Y00), real(0)
    bands = (degree + 1) * (degree + 1)
    directions, basis = local_array(DIRECTION, position), local_array(BASIS, position)
    d_sum, d_basis = local_array(GROUP, position), local_array(BASIS, position)
    results = local_array(POSITION, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        for item in range(BASIS):
            d_basis[_U64(item)] = zero
        for item in range(count if degree > 0 else 0):
            x, y, z, inverse = direction(column(position, 3, start + item), centre)
            keep(directions, item, (x, y, z, inverse))
            keep(basis, item, harmonic_basis(x, y, z))
        for channel in range(3):
            for item in range(count):
                i = _U64(start + item)
                d_sum[_U64(item)] = zero if clamped[channel, i] else d_colour[channel, i]
            for item in range(count):
                d_harmonics[0, channel, _U64(start + item)] = y00 * d_sum[_U64(item)]
            for item in range(count if d_residual.shape[1] > 0 else 0):
                d_residual[channel, _U64(start + item)] = y00 * d_sum[_U64(item)]
            for k in range(1, bands):
                row = (k - 1) * GROUP
                for item in range(count):
                    d_harmonics[_U64(k), channel, _U64(start + item)] = basis[_U64(row + item)] * d_sum[_U64(item)]
                for item in range(count):
                    h = harmonics[_U64(k), channel, _U64(start + item)]
                    d_basis[_U64(row + item)] += d_sum[_U64(item)] * h
            for k in range(bands, harmonics.shape[0]):
                for item in range(count):
                    d_harmonics[_U64(k), channel, _U64(start + item)] = zero
        for item in range(count):
            x, y, z, inverse = kept(directions, 4, item)
            d_direction = harmonic_basis_reverse(x, y, z, kept(d_basis, 15, item))
            keep_where(degree > 0, results, item, direction_reverse(x, y, z, inverse, d_direction))
        write_group(results, start, count, d_position)


_colour_kernel, _colour_reverse_kernel = jit(_colour), jit(_colour_reverse)


def harmonics_forward(
    harmonics: FloatArray, residual: FloatArray | None, position: FloatArray, centre: FloatArray, degree: int
) -> tuple[FloatArray, HarmonicsSaved]:
    """Colour of N Gaussians seen from a camera centre (specification B4).

    harmonics  (K, 3, N) coefficients [band, channel, Gaussian], K >= (degree + 1)^2
    residual   (3, N) added to the degree-0 coefficient (equation 2), or None
    position   (3, N) deformed centre, scene units
    centre     (3,)   camera centre in world axes
    degree     0..3   active degree; higher bands are not read
    returns    (3, N) display colour, >= 0, no upper clamp

    Reverse: `harmonics_reverse`; the gradient is zero for a channel whose value before the clamp is < 0.
    Edges:   a Gaussian at the camera centre uses band 0 only.
    Oracle:  tests/oracle/splatting_oracle.py; rotation invariance of every band.
    """
    dtype = position.dtype
    if not 0 <= degree <= 3 or harmonics.shape[0] < (degree + 1) ** 2:
        raise ValueError(f"degree {degree} needs {(degree + 1) ** 2} bands, harmonics has {harmonics.shape[0]}; 0..3")
    centre = np.ascontiguousarray(centre, dtype)
    colour = np.empty((3, position.shape[1]), dtype)
    clamped = np.empty(colour.shape, np.bool_)
    extra = np.empty((3, 0), dtype) if residual is None else residual
    n = position.shape[1]
    parallel_for(_colour_kernel, n, harmonics, extra, position, centre, degree, colour, clamped)
    return colour, HarmonicsSaved(harmonics, residual, position, centre, degree, clamped)


def harmonics_reverse(d_colour: FloatArray, saved: HarmonicsSaved) -> HarmonicsGrads:
    """Gradients by coefficients, residual, position and camera centre from dL/dcolour (3, N)."""
    n = saved.position.shape[1]
    dtype = saved.position.dtype
    d_harmonics = np.empty_like(saved.harmonics)
    d_residual = np.empty((3, 0 if saved.residual is None else n), dtype)
    d_position = np.empty((3, n), dtype)
    parallel_for(
        _colour_reverse_kernel, n,
        saved.harmonics, saved.position, saved.centre, saved.degree, saved.clamped,
        d_colour, d_harmonics, d_residual, d_position,
    )  # fmt: skip
    residual = None if saved.residual is None else d_residual
    return HarmonicsGrads(d_harmonics, residual, d_position, -sum_columns(d_position, DIRECTIONS_PER_SUM))
