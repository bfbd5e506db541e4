"""Fast path of training: the reverse pass of a Fourier residual and its Adam step in one sweep.

Both residuals are sums over atoms. The coefficient gradient (3, 2F, N) is therefore the outer product of the atoms
(2F,) and the gradient of the sums (3, N). This module computes it for one piece of one row at a time, including the
gradient of the Matérn penalty, and never stores it. The operations and their order are those of `spread`,
`matern_penalty_reverse` and `adam_update`: results are bitwise equal (tested).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from endotsr.method.equations.deformation import GAUSSIANS_PER_PIECE
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_for
from endotsr.training.fitting.adam import AdamState, Rate, adam_row, check_layout, step_factors


class RowStep(NamedTuple):
    """Scalars of `adam_row`, in float64."""

    rate: float  # learning rate, divided by the bias correction of the first moment
    root: float  # inverse root of the bias correction of the second moment
    beta1: float
    beta2: float
    epsilon: float


def coefficients_adam_step(
    d_sums: FloatArray,
    atoms: FloatArray,
    shrink: FloatArray | None,
    parameter: FloatArray,
    state: AdamState,
    name: str,
    rates: Mapping[str, Rate],
    beta1: float,
    beta2: float,
    epsilon: float,
) -> None:
    """Update coefficients (3, 2F, N), and their moments in `state`, in place.

    d_sums     (3, N) gradient of the loss with respect to sum_a coefficients[:, a] atoms[a]
    atoms      (2F,) the atoms of that sum
    shrink     (2F,) of `penalty_factors`: shrink[a] x coefficients[:, a] is added to the gradient; or None
    parameter  (3, 2F, N) the coefficients themselves
    state      moments and steps
    rates      learning rates by name, one number each
    name       name of this array

    Raises: ValueError if shapes, dtypes or layouts disagree. Oracle: the three functions named above, bitwise.
    """
    first, second, dtype = state.first[name], state.second[name], parameter.dtype
    check_layout(parameter, {name: parameter, f"first {name}": first, f"second {name}": second})
    axes, count, n = parameter.shape
    factors = np.zeros(0, dtype) if shrink is None else np.ascontiguousarray(shrink, dtype)
    if d_sums.shape != (axes, n) or atoms.shape != (count,) or factors.size not in (0, count):
        raise ValueError(f"{name} {parameter.shape}: got {d_sums.shape}, atoms {atoms.shape}, factors {factors.shape}")
    learning_rate = rates[name]
    assert isinstance(learning_rate, float)  # rates per part of the leading axis are not supported here
    state.step[name] += 1
    rate, root = step_factors(state.step[name], learning_rate, beta1, beta2)
    inputs = (np.ascontiguousarray(d_sums, dtype), np.ascontiguousarray(atoms, dtype), factors)
    settings = RowStep(rate, root, float(beta1), float(beta2), float(epsilon))
    parallel_for(_step_kernel, axes * count, *inputs, parameter, first, second, settings)


def _step(first_row, last_row, d_sums, atoms, factors, parameter, first, second, settings):
    """Each task owns one (axis, atom) row."""
    rate, root, beta1, beta2, epsilon = settings
    count, n = parameter.shape[1:]
    gradient = np.empty(GAUSSIANS_PER_PIECE, parameter.dtype)
    for row in range(first_row, last_row):
        c, a = row // count, row % count
        for start in range(0, n, GAUSSIANS_PER_PIECE):
            stop = min(n, start + GAUSSIANS_PER_PIECE)
            p, g, up = parameter[c, a, start:stop], gradient[: stop - start], d_sums[c, start:stop]
            atom = atoms[a]
            for k in range(g.size):
                g[k] = atom * up[k]
            if factors.size > 0:
                factor = factors[a]
                for k in range(g.size):
                    g[k] += factor * p[k]
            adam_row(
                p, g, first[c, a, start:stop], second[c, a, start:stop], rate, root, beta1, beta2, epsilon
            )  # fmt: skip


_step_kernel = jit(_step)
