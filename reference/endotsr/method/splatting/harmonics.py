"""Colour from real spherical harmonics of degree 0 to 3, with the gradient through the view direction (B4).

colour = max(0, 1/2 + sum_k Y_k(direction) h_k), direction from the camera centre to the (deformed) Gaussian.
A colour residual is added to the degree-0 coefficient before the sum; a zero residual leaves the colour bitwise equal.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.constants import Y00
from endotsr.method.kernels.groups import GROUP, column, keep, kept, write_group
from endotsr.method.kernels.jit import jit, jit_inline
from endotsr.method.kernels.sums import sum_columns
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.kernels.vectors import local_array
from endotsr.method.splatting.harmonics_formulas import (
    direction,
    direction_reverse,
    harmonic_basis,
    harmonic_basis_reverse,
)

_U64 = np.uint64  # unsigned: no index wraps around

DIRECTIONS_PER_SUM = 512  # Gaussians per partial sum of the gradient with respect to the camera centre
DIRECTION, BASIS, POSITION = 4 * GROUP, 15 * GROUP, 3 * GROUP  # sizes for a group


class HarmonicsSaved(NamedTuple):
    """Inputs of the forward pass and a flag for every channel clamped at zero."""

    harmonics: FloatArray
    residual: FloatArray | None
    position: FloatArray
    centre: FloatArray
    degree: int
    clamped: NDArray[np.bool_]  # (3, N)


class HarmonicsGrads(NamedTuple):
    """Gradients of the colour stage."""

    d_harmonics: FloatArray  # (K, 3, N); zero above the active degree
    d_residual: FloatArray | None  # (3, N), None when there was no residual
    d_position: FloatArray  # (3, N) through the view direction
    d_centre: FloatArray  # (3,) camera centre


# The number of coefficients is known only at run time. The formulas therefore fill one row of a group per Y_k, and the
# sum over k is one loop over the group per row.


def _fill_basis(position, centre, start, count, directions, basis):
    """Direction, 1/distance and Y_1 ... Y_15 of a group; those above the active degree are not used."""
    for item in range(count):
        x, y, z, inverse = direction(column(position, 3, start + item), centre)
        keep(directions, item, (x, y, z, inverse))
        keep(basis, item, harmonic_basis(x, y, z))


def _colour_channel(harmonics, residual, channel, start, count, terms, basis, sums):
    """1/2 + sum_k Y_k h_k of a group in one channel; `residual` has shape (3, 0) when there is none."""
    y00, half = sums.dtype.type(Y00), sums.dtype.type(0.5)
    for item in range(count):
        sums[_U64(item)] = harmonics[0, channel, _U64(start + item)]
    for item in range(count if residual.shape[1] > 0 else 0):
        sums[_U64(item)] += residual[channel, _U64(start + item)]
    for item in range(count):
        sums[_U64(item)] = half + y00 * sums[_U64(item)]
    for k in range(1, terms):
        for item in range(count):
            y_k = basis[_U64((k - 1) * GROUP + item)]
            sums[_U64(item)] += y_k * harmonics[_U64(k), channel, _U64(start + item)]


def _colour_channel_reverse(harmonics, channel, start, count, terms, basis, d_sums, d_harmonics, d_residual, d_basis):
    """Gradients of coefficients and residual of one channel; adds to the gradient of Y_1 ... Y_15."""
    y00, zero = d_sums.dtype.type(Y00), d_sums.dtype.type(0)
    for item in range(count):
        d_harmonics[0, channel, _U64(start + item)] = y00 * d_sums[_U64(item)]
    for item in range(count if d_residual.shape[1] > 0 else 0):
        d_residual[channel, _U64(start + item)] = y00 * d_sums[_U64(item)]
    for k in range(1, terms):
        row = (k - 1) * GROUP
        for item in range(count):
            d_harmonics[_U64(k), channel, _U64(start + item)] = basis[_U64(row + item)] * d_sums[_U64(item)]
        for item in range(count):
            d_basis[_U64(row + item)] += d_sums[_U64(item)] * harmonics[_U64(k), channel, _U64(start + item)]
    for k in range(terms, harmonics.shape[0]):
        for item in range(count):
            d_harmonics[_U64(k), channel, _U64(start + item)] = zero


_fill_basis_kernel = jit_inline(_fill_basis)
_colour_channel_kernel = jit_inline(_colour_channel)
_colour_channel_reverse_kernel = jit_inline(_colour_channel_reverse)


def _colour(first, stop, harmonics, residual, position, centre, degree, colour, clamped):
    """A channel is clamped where the sum is below zero."""
    zero, terms = position.dtype.type(0), (degree + 1) * (degree + 1)
    directions, basis = local_array(DIRECTION, position), local_array(BASIS, position)
    sums = local_array(GROUP, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        if degree > 0:
            _fill_basis_kernel(position, centre, start, count, directions, basis)
        for channel in range(3):
            _colour_channel_kernel(harmonics, residual, channel, start, count, terms, basis, sums)
            for item in range(count):
                clamped[channel, _U64(start + item)] = sums[_U64(item)] < zero
                colour[channel, _U64(start + item)] = max(sums[_U64(item)], zero)


def _colour_reverse(
    first, stop, harmonics, position, centre, degree, clamped, d_colour, d_harmonics, d_residual, d_position
):
    """A clamped channel has gradient zero; at degree 0 so has the position."""
    zero, terms = position.dtype.type(0), (degree + 1) * (degree + 1)
    directions, basis = local_array(DIRECTION, position), local_array(BASIS, position)
    d_basis, d_sums = local_array(BASIS, position), local_array(GROUP, position)
    results = local_array(POSITION, position)
    for start in range(first, stop, GROUP):
        count = min(GROUP, stop - start)
        if degree > 0:
            _fill_basis_kernel(position, centre, start, count, directions, basis)
            for place in range(BASIS):
                d_basis[_U64(place)] = zero
        for channel in range(3):
            for item in range(count):
                i = _U64(start + item)
                d_sums[_U64(item)] = zero if clamped[channel, i] else d_colour[channel, i]
            _colour_channel_reverse_kernel(
                harmonics, channel, start, count, terms, basis, d_sums, d_harmonics, d_residual, d_basis
            )
        if degree > 0:
            for item in range(count):
                x, y, z, inverse = kept(directions, 4, item)
                d_direction = harmonic_basis_reverse(degree, x, y, z, kept(d_basis, 15, item))
                keep(results, item, direction_reverse(x, y, z, inverse, d_direction))
        else:
            for place in range(POSITION):
                results[_U64(place)] = zero
        write_group(results, start, count, d_position)


_colour_kernel, _colour_reverse_kernel = jit(_colour), jit(_colour_reverse)


def harmonics_forward(
    harmonics: FloatArray, residual: FloatArray | None, position: FloatArray, centre: FloatArray, degree: int
) -> tuple[FloatArray, HarmonicsSaved]:
    """Colour of N Gaussians seen from a camera centre (specification B4).

    harmonics  (K, 3, N) coefficients [k, channel, Gaussian], K >= (degree + 1)^2
    residual   (3, N) added to the degree-0 coefficient (equation 2), or None
    position   (3, N) deformed centre, scene units
    centre     (3,)   camera centre in world axes
    degree     0..3   active degree; coefficients above it are not read
    returns    (3, N) display colour, >= 0, no upper clamp

    Reverse: `harmonics_reverse`; the gradient is zero for a channel whose value before the clamp is < 0.
    Edges:   a Gaussian at the camera centre uses degree 0 only.
    Raises:  ValueError for a degree outside 0..3, or too few coefficients.
    Oracle:  `endotsr.definition.harmonics`; rotation invariance of every degree.
    """
    dtype = position.dtype
    if not 0 <= degree <= 3 or harmonics.shape[0] < (degree + 1) ** 2:
        raise ValueError(
            f"degree {degree} needs {(degree + 1) ** 2} coefficients, harmonics has {harmonics.shape[0]}; use 0..3"
        )
    centre = np.ascontiguousarray(centre, dtype)
    colour = np.empty((3, position.shape[1]), dtype)
    clamped = np.empty(colour.shape, np.bool_)
    extra = np.empty((3, 0), dtype) if residual is None else residual
    n = position.shape[1]
    parallel_for(_colour_kernel, n, harmonics, extra, position, centre, degree, colour, clamped)
    return colour, HarmonicsSaved(harmonics, residual, position, centre, degree, clamped)


def harmonics_reverse(d_colour: FloatArray, saved: HarmonicsSaved) -> HarmonicsGrads:
    """Gradients with respect to coefficients, residual, position and camera centre from dL/dcolour (3, N)."""
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
    d_centre = 0 - sum_columns(d_position, DIRECTIONS_PER_SUM)
    return HarmonicsGrads(d_harmonics, residual, d_position, d_centre)
