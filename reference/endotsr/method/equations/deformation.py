"""The flexible deformation model (FDM), equation (B1): ten curves over time per Gaussian.

    psi_c(t) = sum_j weight_cj basis(t; centre_cj, width_cj),     S = width^2 + 1e-4
    quartic:   basis = exp(-u^2),  u = (t - centre)^2 / S         (what Deform3DGS computes)
    gaussian:  basis = exp(-u),    u = (t - centre)^2 / (2 S)     (the textbook form)

Channels 0-2 are added to the position, 3-6 to the raw quaternion, 7-9 to the log-scale, all before activation (by
`scene_at`). In: three arrays (10, B, N) and one time. Out: ten offsets per Gaussian.

These arrays are 510 of about 670 numbers per Gaussian, so the passes are memory-bound. Each (channel, basis) row is
streamed once, in pieces that fit in the second-level cache. Basis values below 2^-60 are 0, so a narrow basis does
not reach most times. A stretch of Gaussians whose bases do not reach t is skipped before its exponentials are computed.
"""

from typing import Literal, NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.exponential import LOG2_E, exp2_nonpositive
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for

Basis = Literal["quartic", "gaussian"]
BASES: tuple[Basis, ...] = ("quartic", "gaussian")

CHANNELS = 10
WIDTH_FLOOR = 1e-4  # added to width^2; keeps u finite at width 0
SMALLEST_EXPONENT = -60.0  # a basis value below 2^-60 (below float64 rounding of 1) is exactly 0: no subnormal numbers
LARGEST_U = 128.0  # above it the basis value is 0 for either basis; keeps u^2 finite far from the centre
REACH_MARGIN = 1.0001  # on the bounds of u below, beyond their rounding
QUARTIC_REACH = REACH_MARGIN * (-SMALLEST_EXPONENT / LOG2_E) ** 0.5  # u above which a basis value is 0
GAUSSIAN_REACH = REACH_MARGIN * -2 * SMALLEST_EXPONENT / LOG2_E
GAUSSIANS_PER_PIECE = 4096  # Gaussians in one piece of a row: long enough for hardware prefetching
GAUSSIANS_PER_STRETCH = 32  # Gaussians of a piece that are skipped together if no basis reaches the time


class DeformationSaved(NamedTuple):
    """References to the inputs, for the reverse pass."""

    weight: FloatArray  # (10, B, N)
    centre: FloatArray  # (10, B, N)
    width: FloatArray  # (10, B, N)
    t: float
    basis: Basis


class DeformationGrads(NamedTuple):
    """Derivative of a loss with respect to the inputs of the deformation."""

    d_fdm_weight: FloatArray  # (10, B, N)
    d_fdm_centre: FloatArray  # (10, B, N)
    d_fdm_width: FloatArray  # (10, B, N)
    d_t: float


def deformation_forward(
    fdm_weight: FloatArray, fdm_centre: FloatArray, fdm_width: FloatArray, t: float, basis: Basis = "quartic"
) -> tuple[FloatArray, DeformationSaved]:
    """Offsets of all Gaussians at time t, equation (B1).

    fdm_weight  (10, B, N)  w; position, quaternion or log-scale units by channel
    fdm_centre  (10, B, N)  theta, normalised time
    fdm_width   (10, B, N)  sigma, normalised time, any sign (only its square counts)
    t           normalised time, rounded to the dtype of the arrays; far from all centres the model fades to the
                canonical pose
    returns     (10, N) offsets in the dtype of the input, and the saved tuple

    Reverse: `deformation_reverse`.
    Edges:   all weights 0 -> offsets exactly 0; B = 0 -> 0; N = 0 -> empty; width 0 is finite. A basis of the initial
             width 0.01 decays within 0.014: it initially barely moves frames between two of the 17 centres.
    Raises:  ValueError if shapes or dtypes disagree or the basis is unknown.
    Oracle:  `endotsr.definition.deformation`.
    """
    _check(fdm_weight, fdm_centre, fdm_width, basis)
    offsets = np.empty((CHANNELS, fdm_weight.shape[2]), fdm_weight.dtype)
    tasks = CHANNELS * ((fdm_weight.shape[2] + GAUSSIANS_PER_PIECE - 1) // GAUSSIANS_PER_PIECE)
    parallel_for(_forward_kernel, tasks, fdm_weight, fdm_centre, fdm_width, float(t), basis == "quartic", offsets)
    return offsets, DeformationSaved(fdm_weight, fdm_centre, fdm_width, float(t), basis)


def deformation_reverse(d_offsets: FloatArray, saved: DeformationSaved) -> DeformationGrads:
    """Reverse of `deformation_forward`.

        quartic:  d/d centre = 4 w e u (t - centre) / S,   d/d width = 4 w e u^2 width / S
        gaussian: d/d centre =   w e   (t - centre) / S,   d/d width = 2 w e u   width / S
        both:     d/d weight = e,   d/dt = - sum d/d centre            (e = basis value)

    d_offsets  (10, N)
    returns    gradients (10, B, N) in the dtype of the parameters; t as a float, summed in float64 in fixed order

    Edges: weights 0 -> gradients of centre and width exactly 0; width 0 -> gradient of width exactly 0 (stuck).
    """
    weight, centre, width, t, basis = saved
    if d_offsets.shape != (CHANNELS, weight.shape[2]) or d_offsets.dtype != weight.dtype:
        raise ValueError(f"d_offsets: expected {weight.dtype} (10, {weight.shape[2]}), got {d_offsets.shape}")
    d_weight, d_centre, d_width = np.empty_like(weight), np.empty_like(weight), np.empty_like(weight)
    row_sums = np.empty(weight.shape[:2], np.float64)
    inputs, outputs = (weight, centre, width, t, basis == "quartic", d_offsets), (d_weight, d_centre, d_width)
    parallel_for(_reverse_kernel, row_sums.size, *inputs, *outputs, row_sums)
    return DeformationGrads(d_weight, d_centre, d_width, -float(row_sums.sum()))


def _check(weight: FloatArray, centre: FloatArray, width: FloatArray, basis: str) -> None:
    if basis not in BASES:
        raise ValueError(f"basis: {basis!r} is unknown; use one of {', '.join(BASES)}")
    if weight.ndim != 3 or weight.shape[0] != CHANNELS:
        raise ValueError(f"fdm_weight: expected (10, B, N), got {weight.shape}")
    for name, array in (("fdm_centre", centre), ("fdm_width", width)):
        if array.shape != weight.shape or array.dtype != weight.dtype:
            raise ValueError(f"{name}: expected {weight.dtype} {weight.shape}, got {array.dtype} {array.shape}")


def _basis_constants(real, quartic):
    """Constants of a basis: 2^(scale u v), v = u slope + constant; the bound `far` of u; the factor of d/d centre."""
    if quartic:
        return real(-LOG2_E), real(1), real(0), real(LARGEST_U), real(4)
    return real(-0.5 * LOG2_E), real(0), real(1), real(2 * LARGEST_U), real(1)


_basis_constants_kernel = jit(_basis_constants)


def _reached(centre, width, t, quartic, reached):
    """Which stretches of a piece have a basis that reaches t: u is at most the cutoff, or NaN.

    reached   (stretches,) int32, written: 0 = every basis value of the stretch is exactly 0
    """
    real = centre.dtype.type
    floor, bound = real(WIDTH_FLOOR), real(QUARTIC_REACH if quartic else GAUSSIAN_REACH)
    full = min(reached.size, centre.size // GAUSSIANS_PER_STRETCH)  # complete stretches
    for k in range(full):
        found = np.int32(0)
        for lane in range(GAUSSIANS_PER_STRETCH):
            i = k * GAUSSIANS_PER_STRETCH + lane
            distance = t - centre[i]
            beyond = distance * distance > bound * (width[i] * width[i] + floor)
            found |= np.int32(not beyond)
        reached[k] = found
    for k in range(full, reached.size):
        reached[k] = 1


def _next_run(reached, k):
    """First and last + 1 Gaussian of the next run of reached stretches, from stretch k on; equal if there is none."""
    first = k
    while first < reached.size and reached[first] == 0:
        first += 1
    stop = first
    while stop < reached.size and reached[stop] != 0:
        stop += 1
    return first * GAUSSIANS_PER_STRETCH, stop * GAUSSIANS_PER_STRETCH, stop


def _add_run(weight, centre, width, t, quartic, out):
    """out += weight x basis value; u is (t - centre)^2 / S for either basis."""
    real = out.dtype.type
    floor, cut = real(WIDTH_FLOOR), real(SMALLEST_EXPONENT)
    scale, slope, constant, far, _ = _basis_constants_kernel(real, quartic)
    for i in range(out.size):
        distance = t - centre[i]
        ratio = distance / (width[i] * width[i] + floor)
        u = distance * ratio
        u = far if u > far else u
        exponent = scale * (u * (u * slope + constant))
        value = exp2_nonpositive(exponent)
        out[i] += weight[i] * (real(0) if exponent < cut else value)


def _reverse_run(weight, centre, width, t, quartic, d_offset, d_weight, d_centre, d_width):
    """Gradients of `_add_run`."""
    real = d_offset.dtype.type
    floor, cut = real(WIDTH_FLOOR), real(SMALLEST_EXPONENT)
    scale, slope, constant, far, factor = _basis_constants_kernel(real, quartic)
    for i in range(d_offset.size):
        distance = t - centre[i]
        inverse = real(1) / (width[i] * width[i] + floor)
        ratio = distance * inverse
        u = distance * ratio
        u = far if u > far else u
        v = u * slope + constant
        exponent = scale * (u * v)
        value = exp2_nonpositive(exponent)
        value = (real(0) if exponent < cut else value) * d_offset[i]
        ratio = real(0) if exponent < cut else ratio
        common = factor * weight[i] * value * v
        d_weight[i] = value
        d_centre[i] = common * ratio
        d_width[i] = common * u * (width[i] * inverse)


_reached_kernel = jit(_reached)
_next_run_kernel = jit(_next_run)
_add_run_kernel = jit(_add_run)
_reverse_run_kernel = jit(_reverse_run)


def _add_row(weight, centre, width, t, quartic, out):
    """out += weight x basis value, over one piece of a row; stretches that no basis reaches are skipped."""
    reached = np.empty((out.size + GAUSSIANS_PER_STRETCH - 1) // GAUSSIANS_PER_STRETCH, np.int32)
    _reached_kernel(centre, width, t, quartic, reached)
    a, b, k = _next_run_kernel(reached, 0)
    while a < b:
        _add_run_kernel(weight[a:b], centre[a:b], width[a:b], t, quartic, out[a:b])
        a, b, k = _next_run_kernel(reached, k)


def _reverse_row(weight, centre, width, t, quartic, d_offset, d_weight, d_centre, d_width):
    """Gradients of one piece of a row; exactly 0 in the stretches that `_add_row` skips."""
    reached = np.empty((d_offset.size + GAUSSIANS_PER_STRETCH - 1) // GAUSSIANS_PER_STRETCH, np.int32)
    _reached_kernel(centre, width, t, quartic, reached)
    d_weight[:], d_centre[:], d_width[:] = 0, 0, 0
    a, b, k = _next_run_kernel(reached, 0)
    while a < b:
        inputs = (weight[a:b], centre[a:b], width[a:b], t, quartic, d_offset[a:b])
        _reverse_run_kernel(*inputs, d_weight[a:b], d_centre[a:b], d_width[a:b])
        a, b, k = _next_run_kernel(reached, k)


add_row = jit(_add_row)
reverse_row = jit(_reverse_row)


def _forward(first, last, weight, centre, width, t, quartic, offsets):
    """Each task owns one piece of one channel, so no cell is written twice."""
    bases, count = weight.shape[1:]
    pieces = (count + GAUSSIANS_PER_PIECE - 1) // GAUSSIANS_PER_PIECE
    time = weight.dtype.type(t)
    for task in range(first, last):
        c, start = task // pieces, (task % pieces) * GAUSSIANS_PER_PIECE
        stop = min(count, start + GAUSSIANS_PER_PIECE)
        out = offsets[c, start:stop]
        for i in range(out.size):
            out[i] = weight.dtype.type(0)
        for j in range(bases):
            w, m, s = weight[c, j, start:stop], centre[c, j, start:stop], width[c, j, start:stop]
            add_row(w, m, s, time, quartic, out)


def _reverse(first, last, weight, centre, width, t, quartic, d_offsets, d_weight, d_centre, d_width, row_sums):
    """Each task owns one (channel, basis) row and sums it over Gaussians in float64, in a fixed order."""
    bases, count = weight.shape[1:]
    time = weight.dtype.type(t)
    for row in range(first, last):
        c, j = row // bases, row % bases
        total = 0.0
        for start in range(0, count, GAUSSIANS_PER_PIECE):
            stop = min(count, start + GAUSSIANS_PER_PIECE)
            w, m, s = weight[c, j, start:stop], centre[c, j, start:stop], width[c, j, start:stop]
            d_w, d_m, d_s = d_weight[c, j, start:stop], d_centre[c, j, start:stop], d_width[c, j, start:stop]
            reverse_row(w, m, s, time, quartic, d_offsets[c, start:stop], d_w, d_m, d_s)
            for i in range(d_m.size):
                total += np.float64(d_m[i])
        row_sums[c, j] = total


_forward_kernel = jit(_forward)
_reverse_kernel = jit(_reverse)
