"""Fast path of training: the reverse pass of the deformation and its Adam step in one sweep.

The gradient of the FDM is (3, 10, B, N), three quarters of all gradients, and is needed once. Here it exists
for one piece of one row at a time, in the first-level cache. The arithmetic is that of
`deformation_reverse` followed by `adam_update`, in the same order: the results are equal bit by bit (tested).
"""

import numpy as np
from numba import prange
from numpy.typing import NDArray

from endotsr.equations.deformation import CHANNELS, PIECE, DeformationSaved, reverse_row
from endotsr.fitting.adam import AdamState, Rate, adam_row, rate_parts, step_factors
from endotsr.jit import jit

FloatArray = NDArray[np.floating]
NAMES = ("fdm_weight", "fdm_centre", "fdm_width")


def deformation_adam_step(
    d_offsets: FloatArray,
    saved: DeformationSaved,
    state: AdamState,
    rates: dict[str, Rate],
    beta1: float,
    beta2: float,
    epsilon: float,
) -> None:
    """Update the FDM arrays held in `saved`, and their moments in `state`, in place.

    d_offsets  (10, N) gradient of the loss by the offsets
    saved      from `deformation_forward`; its weight, centre and width ARE the parameters
    state      moments and steps under the names fdm_weight, fdm_centre, fdm_width
    rates      learning rates under the same names, one each or one per part of the ten channels

    The gradient by t is not formed. Oracle: `deformation_reverse` then `adam_update`, bitwise.
    """
    parameters = (saved.weight, saved.centre, saved.width)
    first, second = [state.first[n] for n in NAMES], [state.second[n] for n in NAMES]
    for array in (*parameters, *first, *second):
        if array.shape != saved.weight.shape or array.dtype != d_offsets.dtype or not array.flags.c_contiguous:
            raise ValueError(f"deformation_adam_step: expected C-contiguous {d_offsets.dtype} {saved.weight.shape}")
    if d_offsets.shape != (CHANNELS, saved.weight.shape[2]):
        raise ValueError(f"d_offsets: expected (10, {saved.weight.shape[2]}), got {d_offsets.shape}")
    rate = np.empty((3, CHANNELS))
    root = np.empty(3)
    for k, name in enumerate(NAMES):
        state.step[name] += 1
        for part, value in rate_parts(rates[name]):
            rate[k, part], root[k] = step_factors(state.step[name], value, beta1, beta2)
    moments = (*first, *second)
    betas = (float(beta1), float(beta2), float(epsilon))
    _step_kernel(*parameters, saved.t, saved.basis == "quartic", d_offsets, moments, rate, root, betas)


def _step(weight, centre, width, t, quartic, d_offsets, moments, rate, root, betas):
    """Each task owns one (channel, basis) row of all nine arrays."""
    m_w, m_m, m_s, v_w, v_m, v_s = moments
    beta1, beta2, epsilon = betas
    channels, bases, count = weight.shape
    time = weight.dtype.type(t)
    for row in prange(channels * bases):
        c, j = row // bases, row % bases
        gradient = np.empty((3, PIECE), weight.dtype)
        for start in range(0, count, PIECE):
            stop = min(count, start + PIECE)
            w, m, s = weight[c, j, start:stop], centre[c, j, start:stop], width[c, j, start:stop]
            d_w, d_m, d_s = gradient[0, : stop - start], gradient[1, : stop - start], gradient[2, : stop - start]
            reverse_row(w, m, s, time, quartic, d_offsets[c, start:stop], d_w, d_m, d_s)
            first, second = m_w[c, j, start:stop], v_w[c, j, start:stop]
            adam_row(w, d_w, first, second, rate[0, c], root[0], beta1, beta2, epsilon)
            first, second = m_m[c, j, start:stop], v_m[c, j, start:stop]
            adam_row(m, d_m, first, second, rate[1, c], root[1], beta1, beta2, epsilon)
            first, second = m_s[c, j, start:stop], v_s[c, j, start:stop]
            adam_row(s, d_s, first, second, rate[2, c], root[2], beta1, beta2, epsilon)


_step_kernel = jit(_step, parallel=True)
