"""Colour from real spherical harmonics of degree 0 to 3, with the gradient through the view direction (B4).

colour = max(0, 1/2 + sum_k Y_k(direction) h_k), direction from the camera centre to the (deformed) Gaussian.
A colour residual is added to the degree-0 coefficient before the sum: with zero residual nothing changes, bit by bit.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.kernels.constants import Y00
from endotsr.kernels.jit import jit
from endotsr.kernels.threads import parallel_for

FloatArray = NDArray[np.floating]

CHUNK = 512  # Gaussians handled at a time

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


# What a block works on stands in one flat array, plane k at k * CHUNK, and is indexed with unsigned integers: no alias
# or wrap-around checks, so the loops become vector code. Planes: direction, 1 / distance, Y_1 ... Y_15, their weights.
_INVERSE, _BASIS, _WEIGHT, _PLANES = 3, 3, 18, 34  # Y_k at _BASIS + k, its weight at _WEIGHT + k, k = 1 ... 15
_U64 = np.uint64


def _directions(position, centre, planes):
    """Unit directions; a Gaussian at the camera centre gets direction and inverse distance zero (band 0 only)."""
    real = planes.dtype.type
    one, zero = real(1), real(0)
    x, y, z = centre[0], centre[1], centre[2]
    px, py, pz = position[0], position[1], position[2]
    for k in range(px.size):
        i = _U64(k)
        dx, dy, dz = px[i] - x, py[i] - y, pz[i] - z
        r = math.sqrt(dx * dx + dy * dy + dz * dz)
        inverse = one / r if r > zero else zero
        planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)] = (
            dx * inverse,
            dy * inverse,
            dz * inverse,
        )
        planes[i + _U64(_INVERSE * CHUNK)] = inverse


def _basis(degree, planes, count):
    """Y_k for k >= 1 up to the active degree; formulas in the specification."""
    real = planes.dtype.type
    c1, c2a, c2b, c2c = real(C1), real(C2A), real(C2B), real(C2C)
    c3a, c3b, c3c, c3d, c3e = real(C3A), real(C3B), real(C3C), real(C3D), real(C3E)
    two, three, four = real(2), real(3), real(4)
    for k in range(count):
        i = _U64(k)
        a, b, c = planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)]
        planes[i + _U64((_BASIS + 1) * CHUNK)] = -c1 * b
        planes[i + _U64((_BASIS + 2) * CHUNK)] = c1 * c
        planes[i + _U64((_BASIS + 3) * CHUNK)] = -c1 * a
    for k in range(count if degree > 1 else 0):
        i = _U64(k)
        a, b, c = planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)]
        aa, bb, cc = a * a, b * b, c * c
        planes[i + _U64((_BASIS + 4) * CHUNK)] = c2a * a * b
        planes[i + _U64((_BASIS + 5) * CHUNK)] = -c2a * b * c
        planes[i + _U64((_BASIS + 6) * CHUNK)] = c2b * (two * cc - aa - bb)
        planes[i + _U64((_BASIS + 7) * CHUNK)] = -c2a * a * c
        planes[i + _U64((_BASIS + 8) * CHUNK)] = c2c * (aa - bb)
    for k in range(count if degree > 2 else 0):
        i = _U64(k)
        a, b, c = planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)]
        aa, bb, cc = a * a, b * b, c * c
        planes[i + _U64((_BASIS + 9) * CHUNK)] = -c3a * b * (three * aa - bb)
        planes[i + _U64((_BASIS + 10) * CHUNK)] = c3b * a * b * c
        planes[i + _U64((_BASIS + 11) * CHUNK)] = -c3c * b * (four * cc - aa - bb)
        planes[i + _U64((_BASIS + 12) * CHUNK)] = c3d * c * (two * cc - three * aa - three * bb)
        planes[i + _U64((_BASIS + 13) * CHUNK)] = -c3c * a * (four * cc - aa - bb)
        planes[i + _U64((_BASIS + 14) * CHUNK)] = c3e * c * (aa - bb)
        planes[i + _U64((_BASIS + 15) * CHUNK)] = -c3a * a * (aa - three * bb)


def _basis_gradient(degree, planes, gx, gy, gz):
    """g = sum_k weight_k dY_k/d(x, y, z), the three taken as independent; degree >= 1."""
    real = planes.dtype.type
    c1, c2a, c2b, c2c = real(C1), real(C2A), real(C2B), real(C2C)
    c3a, c3b, c3c, c3d, c3e = real(C3A), real(C3B), real(C3C), real(C3D), real(C3E)
    two, three, four, six, eight = real(2), real(3), real(4), real(6), real(8)
    for k in range(gx.size):
        i = _U64(k)
        w1, w2 = (
            planes[i + _U64((_WEIGHT + 1) * CHUNK)],
            planes[i + _U64((_WEIGHT + 2) * CHUNK)],
        )
        w3 = planes[i + _U64((_WEIGHT + 3) * CHUNK)]
        gx[i], gy[i], gz[i] = -c1 * w3, -c1 * w1, c1 * w2
    for k in range(gx.size if degree > 1 else 0):
        i = _U64(k)
        a, b, c = planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)]
        w4, w5 = (
            planes[i + _U64((_WEIGHT + 4) * CHUNK)],
            planes[i + _U64((_WEIGHT + 5) * CHUNK)],
        )
        w6, w7 = (
            planes[i + _U64((_WEIGHT + 6) * CHUNK)],
            planes[i + _U64((_WEIGHT + 7) * CHUNK)],
        )
        w8 = planes[i + _U64((_WEIGHT + 8) * CHUNK)]
        gx[i] += c2a * (b * w4 - c * w7) - two * c2b * a * w6 + two * c2c * a * w8
        gy[i] += c2a * (a * w4 - c * w5) - two * c2b * b * w6 - two * c2c * b * w8
        gz[i] += -c2a * (b * w5 + a * w7) + four * c2b * c * w6
    for k in range(gx.size if degree > 2 else 0):
        i = _U64(k)
        a, b, c = planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)]
        aa, bb, cc = a * a, b * b, c * c
        w9, w10 = (
            planes[i + _U64((_WEIGHT + 9) * CHUNK)],
            planes[i + _U64((_WEIGHT + 10) * CHUNK)],
        )
        w11, w12 = (
            planes[i + _U64((_WEIGHT + 11) * CHUNK)],
            planes[i + _U64((_WEIGHT + 12) * CHUNK)],
        )
        w13, w14 = (
            planes[i + _U64((_WEIGHT + 13) * CHUNK)],
            planes[i + _U64((_WEIGHT + 14) * CHUNK)],
        )
        w15 = planes[i + _U64((_WEIGHT + 15) * CHUNK)]
        u = -c3a * six * a * b * w9 + c3b * b * c * w10 + c3c * two * a * b * w11 - c3d * six * a * c * w12
        u += -c3c * (four * cc - three * aa - bb) * w13 + c3e * two * a * c * w14 - c3a * three * (aa - bb) * w15
        v = -c3a * three * (aa - bb) * w9 + c3b * a * c * w10 - c3c * (four * cc - aa - three * bb) * w11
        v += -c3d * six * b * c * w12 + c3c * two * a * b * w13 - c3e * two * b * c * w14 + c3a * six * a * b * w15
        w = c3b * a * b * w10 - c3c * eight * b * c * w11 + c3d * (six * cc - three * aa - three * bb) * w12
        w += -c3c * eight * a * c * w13 + c3e * (aa - bb) * w14
        gx[i] += u
        gy[i] += v
        gz[i] += w


_directions_kernel = jit(_directions)
_basis_kernel = jit(_basis)
_basis_gradient_kernel = jit(_basis_gradient)


def _direction_to_position_block(degree, planes, d_position, d_centre):
    """From direction to position: drop the radial part, divide by the distance.

    `d_centre` comes as 0 and gets minus the sum.
    """
    zero = planes.dtype.type(0)
    gx, gy, gz = d_position[0], d_position[1], d_position[2]
    if degree == 0:
        for i in range(gx.size):
            gx[i] = gy[i] = gz[i] = zero
        return
    _basis_gradient_kernel(degree, planes, gx, gy, gz)
    for k in range(gx.size):
        i = _U64(k)
        x, y, z = planes[i], planes[i + _U64(CHUNK)], planes[i + _U64(2 * CHUNK)]
        inverse = planes[i + _U64(_INVERSE * CHUNK)]
        along = gx[i] * x + gy[i] * y + gz[i] * z
        gx[i] = (gx[i] - along * x) * inverse
        gy[i] = (gy[i] - along * y) * inverse
        gz[i] = (gz[i] - along * z) * inverse
    sum_x, sum_y, sum_z = zero, zero, zero
    for i in range(gx.size):
        sum_x += gx[i]
        sum_y += gy[i]
        sum_z += gz[i]
    d_centre[0], d_centre[1], d_centre[2] = -sum_x, -sum_y, -sum_z


_direction_to_position = jit(_direction_to_position_block)


def _colour_block(harmonics, residual, position, centre, degree, colour, clamped, a, e):
    """Gaussians a to e; `residual` has shape (3, 0) when there is none."""
    real = position.dtype.type
    y00, half, zero = real(Y00), real(0.5), real(0)
    bands = (degree + 1) * (degree + 1)
    planes = np.empty(_PLANES * CHUNK, position.dtype)
    if degree > 0:
        _directions_kernel(position[:, a:e], centre, planes)
        _basis_kernel(degree, planes, e - a)
    for channel in range(3):
        out, flag, base = colour[channel, a:e], clamped[channel, a:e], harmonics[0, channel, a:e]
        if residual.shape[1] > 0:
            extra = residual[channel, a:e]
            for i in range(out.size):
                out[i] = half + y00 * (base[i] + extra[i])
        else:
            for i in range(out.size):
                out[i] = half + y00 * base[i]
        for k in range(1, bands):
            y, h = planes[(_BASIS + k) * CHUNK :], harmonics[k, channel, a:e]
            for i in range(out.size):
                out[i] += y[i] * h[i]
        for i in range(out.size):
            flag[i] = out[i] < zero
            out[i] = max(out[i], zero)


def _colour_reverse_block(
    harmonics, position, centre, degree, clamped, d_colour, d_harmonics, d_base, d_position, d_centre, a, e
):
    """Gaussians a to e; `d_base` is the gradient of the residual, shape (3, 0) when there is none."""
    real = position.dtype.type
    y00, zero = real(Y00), real(0)
    bands = (degree + 1) * (degree + 1)
    gc = np.empty(e - a, position.dtype)
    planes = np.zeros(_PLANES * CHUNK, position.dtype)  # weight of Y_k: sum over channels of g h_k
    if degree > 0:
        _directions_kernel(position[:, a:e], centre, planes)
        _basis_kernel(degree, planes, e - a)
    for channel in range(3):
        up, flag, out = d_colour[channel, a:e], clamped[channel, a:e], d_harmonics[0, channel, a:e]
        for i in range(gc.size):
            gc[i] = zero if flag[i] else up[i]
            out[i] = y00 * gc[i]
        if d_base.shape[1] > 0:
            extra = d_base[channel, a:e]
            for i in range(gc.size):
                extra[i] = out[i]
        for k in range(1, harmonics.shape[0]):
            out = d_harmonics[k, channel, a:e]
            if k >= bands:
                for i in range(out.size):
                    out[i] = zero
                continue
            y, h = planes[(_BASIS + k) * CHUNK :], harmonics[k, channel, a:e]
            w = planes[(_WEIGHT + k) * CHUNK :]
            for i in range(out.size):
                out[i] = y[i] * gc[i]
                w[i] += gc[i] * h[i]
    _direction_to_position(degree, planes, d_position[:, a:e], d_centre)


_colour_kernel = jit(_colour_block)
_colour_reverse_kernel = jit(_colour_reverse_block)


def _colour_blocks(first, last, harmonics, residual, position, centre, degree, colour, clamped):
    n = position.shape[1]
    for block in range(first, last):
        a, e = block * CHUNK, min(n, block * CHUNK + CHUNK)
        _colour_kernel(harmonics, residual, position, centre, degree, colour, clamped, a, e)


def _colour_reverse_blocks(
    first, last, harmonics, position, centre, degree, clamped, d_colour, d_harmonics, d_base, d_position, d_centres
):
    n = position.shape[1]
    for block in range(first, last):
        a, e = block * CHUNK, min(n, block * CHUNK + CHUNK)
        _colour_reverse_kernel(
            harmonics, position, centre, degree, clamped, d_colour, d_harmonics, d_base, d_position,
            d_centres[block], a, e,
        )  # fmt: skip


_colour_blocks_kernel = jit(_colour_blocks)
_colour_reverse_blocks_kernel = jit(_colour_reverse_blocks)


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
    blocks = (position.shape[1] + CHUNK - 1) // CHUNK
    parallel_for(_colour_blocks_kernel, blocks, harmonics, extra, position, centre, degree, colour, clamped)
    return colour, HarmonicsSaved(harmonics, residual, position, centre, degree, clamped)


def harmonics_reverse(d_colour: FloatArray, saved: HarmonicsSaved) -> HarmonicsGrads:
    """Gradients by coefficients, residual, position and camera centre from dL/dcolour (3, N)."""
    n = saved.position.shape[1]
    dtype = saved.position.dtype
    d_harmonics = np.empty_like(saved.harmonics)
    d_residual = np.empty((3, 0 if saved.residual is None else n), dtype)
    d_position = np.empty((3, n), dtype)
    d_centres = np.zeros(((n + CHUNK - 1) // CHUNK, 3), dtype)
    parallel_for(
        _colour_reverse_blocks_kernel, d_centres.shape[0],
        saved.harmonics, saved.position, saved.centre, saved.degree, saved.clamped,
        d_colour, d_harmonics, d_residual, d_position, d_centres,
    )  # fmt: skip
    residual = None if saved.residual is None else d_residual
    return HarmonicsGrads(d_harmonics, residual, d_position, d_centres.sum(axis=0))
