"""Fast path of training: the reverse pass of the deformation, its Adam step and the next forward pass in one sweep.

The gradient of the FDM, (3, 10, B, N), is the largest of all and is used once. This module computes it for one piece of
one row at a time, in the second-level cache. There it also computes the offsets of the next iteration from the updated
numbers, so the arrays are read from memory only once. The operations and their order are those of
`deformation_reverse`, `adam_update` and `deformation_forward`: results are bitwise equal (tested).
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.equations.deformation import CHANNELS, GAUSSIANS_PER_PIECE, DeformationSaved, add_row, reverse_row
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.training.fitting.adam import AdamState, Rate, adam_row, check_layout, rate_parts, step_factors

NAMES = ("fdm_weight", "fdm_centre", "fdm_width")


class FdmArrays(NamedTuple):
    """The three arrays of the FDM, each (10, B, N): the parameters, or their first or second moments."""

    weight: FloatArray
    centre: FloatArray
    width: FloatArray


class StepSettings(NamedTuple):
    """Scalars of `adam_row` for each of the three arrays, in float64."""

    rate: FloatArray  # (3, 10) learning rate of a channel, divided by the bias correction of the first moment
    root: FloatArray  # (3,) inverse root of the bias correction of the second moment
    beta1: float
    beta2: float
    epsilon: float


class BasisTimes(NamedTuple):
    """The times at which the time bases are evaluated, normalised, and the type of basis."""

    t: float  # of the gradient
    t_ahead: float  # of the offsets from the updated arrays
    quartic: bool


def deformation_adam_step(
    d_offsets: FloatArray,
    parameters: FdmArrays,
    saved: DeformationSaved,
    state: AdamState,
    rates: dict[str, Rate],
    beta1: float,
    beta2: float,
    epsilon: float,
    ahead: float | None = None,
) -> FloatArray | None:
    """Update the FDM arrays, and their moments in `state`, in place.

    d_offsets  (10, N) gradient of the loss with respect to the offsets
    parameters the arrays that are updated
    saved      from `deformation_forward` of the same arrays; its time and basis are used
    state      moments and steps under the names fdm_weight, fdm_centre, fdm_width
    rates      learning rates under the same names, one each or one per part of the ten channels
    ahead      normalised time at which the offsets of the updated arrays are computed; None = not computed
    returns    these offsets, (10, N); None without `ahead`

    The gradient with respect to t is not computed.
    Raises: ValueError with the name of an array that has the wrong shape, dtype or layout.
    Oracle: `deformation_reverse`, `adam_update`, `deformation_forward`, bitwise.
    """
    first, second = (FdmArrays(*(moments[name] for name in NAMES)) for moments in (state.first, state.second))
    for k, name in enumerate(NAMES):
        check_layout(parameters.weight, {name: parameters[k], f"first {name}": first[k], f"second {name}": second[k]})
    count, dtype = parameters.weight.shape[2], parameters.weight.dtype
    if d_offsets.shape != (CHANNELS, count) or d_offsets.dtype != dtype:
        raise ValueError(f"d_offsets: expected {dtype} {(CHANNELS, count)}, got {d_offsets.dtype} {d_offsets.shape}")
    rate = np.empty((3, CHANNELS))
    root = np.empty(3)
    for k, name in enumerate(NAMES):
        state.step[name] += 1
        for part, value in rate_parts(rates[name]):
            rate[k, part], root[k] = step_factors(state.step[name], value, beta1, beta2)
    settings = StepSettings(rate, root, float(beta1), float(beta2), float(epsilon))
    times = BasisTimes(saved.t, saved.t if ahead is None else float(ahead), saved.basis == "quartic")
    offsets = np.empty((CHANNELS, count if ahead is not None else 0), dtype)
    tasks = CHANNELS * ((count + GAUSSIANS_PER_PIECE - 1) // GAUSSIANS_PER_PIECE)
    parallel_for(_step_kernel, tasks, parameters, first, second, d_offsets, settings, times, offsets)
    return offsets if ahead is not None else None


def _step(first_task, last_task, parameters, first, second, d_offsets, settings, times, offsets):
    """Each task owns one piece of one channel of all nine arrays; `offsets` has no columns if not requested."""
    (weight, centre, width), (t, t_ahead, quartic) = parameters, times
    rate, root, beta1, beta2, epsilon = settings
    bases, count = weight.shape[1:]
    pieces = (count + GAUSSIANS_PER_PIECE - 1) // GAUSSIANS_PER_PIECE
    time, time_ahead = weight.dtype.type(t), weight.dtype.type(t_ahead)
    gradient = np.empty((3, GAUSSIANS_PER_PIECE), weight.dtype)
    for task in range(first_task, last_task):
        c, start = task // pieces, (task % pieces) * GAUSSIANS_PER_PIECE
        stop = min(count, start + GAUSSIANS_PER_PIECE)
        later = offsets[c, start:stop]
        for i in range(later.size):
            later[i] = weight.dtype.type(0)
        for j in range(bases):
            w, m, s = weight[c, j, start:stop], centre[c, j, start:stop], width[c, j, start:stop]
            reverse_row(w, m, s, time, quartic, d_offsets[c, start:stop], gradient[0], gradient[1], gradient[2])
            for k in range(3):
                piece, mean, square = parameters[k][c, j], first[k][c, j], second[k][c, j]
                adam_row(
                    piece[start:stop], gradient[k], mean[start:stop], square[start:stop],
                    rate[k, c], root[k], beta1, beta2, epsilon,
                )  # fmt: skip
            add_row(w, m, s, time_ahead, quartic, later)


_step_kernel = jit(_step)
