"""Fast path of training: the reverse pass of the deformation, its Adam step and the next forward pass in one sweep.

The gradient of the FDM is (3, 10, B, N), three quarters of all gradients, and is needed once. Here it exists
for one piece of one row at a time, in the second-level cache. The offsets of the next iteration are computed there as
well, from the updated numbers, so that the arrays are not read from memory a second time. The arithmetic is that of
`deformation_reverse`, `adam_update` and `deformation_forward`, in the same order: all results are equal bit by bit
(tested).
"""

import numpy as np

from endotsr.equations.deformation import CHANNELS, GAUSSIANS_PER_PIECE, DeformationSaved, add_row, reverse_row
from endotsr.fitting.adam import AdamState, Rate, adam_row, check_layout, rate_parts, step_factors
from endotsr.kernels.arrays import FloatArray
from endotsr.kernels.jit import jit
from endotsr.kernels.threads import parallel_for

NAMES = ("fdm_weight", "fdm_centre", "fdm_width")


def deformation_adam_step(
    d_offsets: FloatArray,
    saved: DeformationSaved,
    state: AdamState,
    rates: dict[str, Rate],
    beta1: float,
    beta2: float,
    epsilon: float,
    ahead: float | None = None,
) -> FloatArray | None:
    """Update the FDM arrays held in `saved`, and their moments in `state`, in place.

    d_offsets  (10, N) gradient of the loss by the offsets
    saved      from `deformation_forward`; its weight, centre and width are the parameters themselves
    state      moments and steps under the names fdm_weight, fdm_centre, fdm_width
    rates      learning rates under the same names, one each or one per part of the ten channels
    ahead      normalised time at which the offsets of the updated arrays are computed; None = not computed
    returns    those offsets, (10, N); None without `ahead`

    The gradient by t is not formed.
    Raises: ValueError naming the array whose shape, dtype or layout does not fit.
    Oracle: `deformation_reverse`, `adam_update`, `deformation_forward`, bitwise.
    """
    parameters = (saved.weight, saved.centre, saved.width)
    first, second = [state.first[n] for n in NAMES], [state.second[n] for n in NAMES]
    for k, name in enumerate(NAMES):
        check_layout(saved.weight, {name: parameters[k], f"first {name}": first[k], f"second {name}": second[k]})
    expected = (CHANNELS, saved.weight.shape[2])
    if d_offsets.shape != expected or d_offsets.dtype != saved.weight.dtype:
        raise ValueError(
            f"d_offsets: expected {saved.weight.dtype} {expected}, got {d_offsets.dtype} {d_offsets.shape}"
        )
    rate = np.empty((3, CHANNELS))
    root = np.empty(3)
    for k, name in enumerate(NAMES):
        state.step[name] += 1
        for part, value in rate_parts(rates[name]):
            rate[k, part], root[k] = step_factors(state.step[name], value, beta1, beta2)
    moments = (*first, *second)
    inputs = (*parameters, saved.t, saved.basis == "quartic", d_offsets)
    settings = (rate, root, float(beta1), float(beta2), float(epsilon))
    count = saved.weight.shape[2]
    offsets = np.empty((CHANNELS, count if ahead is not None else 0), saved.weight.dtype)
    tasks = CHANNELS * ((count + GAUSSIANS_PER_PIECE - 1) // GAUSSIANS_PER_PIECE)
    parallel_for(_step_kernel, tasks, *inputs, *moments, *settings, saved.t if ahead is None else float(ahead), offsets)
    return offsets if ahead is not None else None


def _adam_piece(parameter, gradient, first, second, c, j, start, rate, root, beta1, beta2, epsilon):
    """Adam step of one piece of row (c, j) of a parameter; gradient (GAUSSIANS_PER_PIECE,) holds that of the piece."""
    stop = min(parameter.shape[2], start + GAUSSIANS_PER_PIECE)
    adam_row(
        parameter[c, j, start:stop], gradient, first[c, j, start:stop], second[c, j, start:stop],
        rate, root, beta1, beta2, epsilon,
    )  # fmt: skip


_adam_piece_kernel = jit(_adam_piece)


def _step(
    first, last, weight, centre, width, t, quartic, d_offsets, m_w, m_m, m_s, v_w, v_m, v_s,
    rate, root, beta1, beta2, epsilon, ahead, offsets,
):  # fmt: skip
    """Each task owns one piece of one channel, of all nine arrays; `offsets` has no columns if none are computed."""
    bases, count = weight.shape[1:]
    pieces = (count + GAUSSIANS_PER_PIECE - 1) // GAUSSIANS_PER_PIECE
    time, time_ahead = weight.dtype.type(t), weight.dtype.type(ahead)
    gradient = np.empty((3, GAUSSIANS_PER_PIECE), weight.dtype)
    d_w, d_m, d_s = gradient[0], gradient[1], gradient[2]
    for task in range(first, last):
        c, start = task // pieces, (task % pieces) * GAUSSIANS_PER_PIECE
        stop = min(count, start + GAUSSIANS_PER_PIECE)
        later = offsets[c, start:stop]
        for i in range(later.size):
            later[i] = weight.dtype.type(0)
        for j in range(bases):
            w, m, s = weight[c, j, start:stop], centre[c, j, start:stop], width[c, j, start:stop]
            reverse_row(w, m, s, time, quartic, d_offsets[c, start:stop], d_w, d_m, d_s)
            _adam_piece_kernel(weight, d_w, m_w, v_w, c, j, start, rate[0, c], root[0], beta1, beta2, epsilon)
            _adam_piece_kernel(centre, d_m, m_m, v_m, c, j, start, rate[1, c], root[1], beta1, beta2, epsilon)
            _adam_piece_kernel(width, d_s, m_s, v_s, c, j, start, rate[2, c], root[2], beta1, beta2, epsilon)
            add_row(w, m, s, time_ahead, quartic, later)


_step_kernel = jit(_step)
