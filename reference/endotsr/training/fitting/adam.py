"""Adam, equation (B10): elementwise, in place, bitwise equal for any number of threads.

    m <- beta1 m + (1 - beta1) g            v <- beta2 v + (1 - beta2) g^2
    p <- p - rate (m / (1 - beta1^k)) / (sqrt(v / (1 - beta2^k)) + epsilon)

k counts the steps of one array: an array created during a run starts with k = 0 and zero moments.
In: parameters and gradients by name, and one rate per name (or one per part of the leading axis). This module
is independent of schedules and Gaussians.

Two consequences: a zero gradient still moves a parameter by its momentum. With epsilon 1e-15, a gradient of pure
rounding noise moves a parameter as far as a large one would; gradients are therefore summed in a fixed order.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.gather import regather_columns
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_calls, parallel_for

Rate = float | tuple[tuple[slice, float], ...]
"""One learning rate, or one per part of the leading axis: ((slice(0, 1), 2.5e-3), (slice(1, None), 1.25e-4))."""

NUMBERS_PER_TASK = 4096  # numbers in one task
SMALLEST_MOMENT = (
    1.1754943508222875e-38  # smallest normal float32; a smaller first moment becomes 0, in both precisions
)


@dataclass
class AdamState:
    """Moments and step counters by array name; arrays are updated in place."""

    first: dict[str, FloatArray] = field(default_factory=dict)  # m, shape of the parameter
    second: dict[str, FloatArray] = field(default_factory=dict)  # v, shape of the parameter
    step: dict[str, int] = field(default_factory=dict)  # k, number of steps so far


def adam_state(parameters: Mapping[str, FloatArray]) -> AdamState:
    """Fresh state (zero moments, step 0) for the given arrays."""
    state = AdamState()
    for name, array in parameters.items():
        add_array(state, name, array)
    return state


def add_array(state: AdamState, name: str, array: FloatArray) -> None:
    """Add zero moments and step 0 for one more array; an existing entry of this name is replaced."""
    state.first[name], state.second[name], state.step[name] = np.zeros_like(array), np.zeros_like(array), 0


def regather(state: AdamState, names: Iterable[str], source: NDArray[np.intp], kept: int) -> None:
    """Gather the moments of arrays whose columns were gathered: column i becomes source[i], or zero from `kept` on.

    names    the gathered arrays; the moments of the others, and all step counters, are unchanged
    source   (M,) and `kept`: see `gather_columns`

    The moments are regathered in place, so old and new moments are never in memory together.
    """

    def moved(group: dict[str, FloatArray], name: str) -> None:
        group[name] = regather_columns(group[name], source, kept)

    parallel_calls(*(partial(moved, group, name) for group in (state.first, state.second) for name in names))


def adam_update(
    state: AdamState,
    parameters: Mapping[str, FloatArray],
    gradients: Mapping[str, FloatArray],
    rates: Mapping[str, Rate],
    beta1: float,
    beta2: float,
    epsilon: float,
) -> None:
    """One step of every array named in `gradients`; all other arrays are unchanged."""
    for name, gradient in gradients.items():
        parameter, first, second = parameters[name], state.first[name], state.second[name]
        state.step[name] += 1
        for part, rate in rate_parts(rates[name]):
            adam_step(
                parameter[part],
                gradient[part],
                first[part],
                second[part],
                state.step[name],
                rate,
                beta1,
                beta2,
                epsilon,
            )


def rate_parts(rate: Rate) -> tuple[tuple[slice, float], ...]:
    """The rate as parts of the leading axis."""
    return rate if isinstance(rate, tuple) else ((slice(None), rate),)


def adam_step(
    parameter: FloatArray,
    gradient: FloatArray,
    first: FloatArray,
    second: FloatArray,
    step: int,
    learning_rate: float,
    beta1: float,
    beta2: float,
    epsilon: float,
) -> None:
    """One Adam step in place.

    parameter, gradient, first, second   one shape, one dtype, C-contiguous; all but the gradient are updated
    step                                 1 at the first step of this array
    learning_rate, beta1, beta2, epsilon scalars; the bias corrections are computed in float64

    Edges:  empty arrays are allowed; with gradient and moments 0, the parameter is bitwise unchanged. A first moment
            below SMALLEST_MOMENT becomes 0: subnormal numbers are slow, and with epsilon 1e-15 they move a parameter
            by less than 1e-21 of the rate.
    Raises: ValueError for unequal shapes or dtypes, non-contiguous arrays, or step < 1.
    Oracle: `endotsr.definition.adam`; tests/oracle/adam.py.
    """
    check_layout(parameter, {"parameter": parameter, "gradient": gradient, "first": first, "second": second})
    rate, root = step_factors(step, learning_rate, beta1, beta2)
    p, g, m, v = (a.reshape(-1) for a in (parameter, gradient, first, second))  # views: contiguous arrays
    tasks = (p.size + NUMBERS_PER_TASK - 1) // NUMBERS_PER_TASK
    parallel_for(_adam_kernel, tasks, p, g, m, v, rate, root, float(beta1), float(beta2), float(epsilon))


def check_layout(like: FloatArray, arrays: Mapping[str, FloatArray]) -> None:
    """Check shape, dtype and layout; otherwise a step could fail midway or update a copy.

    like   array with the expected shape and dtype

    Raises: ValueError with the name of the first array that has another shape or dtype or is not C-contiguous.
    """
    for name, a in arrays.items():
        if a.shape != like.shape or a.dtype != like.dtype or not a.flags.c_contiguous:
            kind = "C-contiguous" if a.flags.c_contiguous else "strided"
            raise ValueError(f"{name}: expected C-contiguous {like.dtype} {like.shape}, got {kind} {a.dtype} {a.shape}")


def step_factors(step: int, learning_rate: float, beta1: float, beta2: float) -> tuple[float, float]:
    """rate / (1 - beta1^k) and 1 / sqrt(1 - beta2^k): the bias corrections, in float64."""
    if step < 1:
        raise ValueError(f"step: {step} < 1")
    return learning_rate / (1.0 - beta1**step), 1.0 / (1.0 - beta2**step) ** 0.5


def _adam_row(parameter, gradient, first, second, rate, root, beta1, beta2, epsilon):
    """One piece of a row; scalars are float64 and rounded here, once, to the dtype of the arrays."""
    real = parameter.dtype.type
    keep1, keep2, new1, new2 = real(beta1), real(beta2), real(1.0 - beta1), real(1.0 - beta2)
    rate, root, epsilon = real(rate), real(root), real(epsilon)
    tiny = real(SMALLEST_MOMENT)
    for i in range(parameter.size):
        g = gradient[i]
        m = keep1 * first[i] + new1 * g
        v = keep2 * second[i] + new2 * (g * g)
        m = real(0) if abs(m) < tiny else m
        first[i] = m
        second[i] = v
        parameter[i] -= rate * m / (np.sqrt(v) * root + epsilon)


adam_row = jit(_adam_row)


def _adam(first_task, last_task, parameter, gradient, first, second, rate, root, beta1, beta2, epsilon):
    start, stop = first_task * NUMBERS_PER_TASK, min(parameter.size, last_task * NUMBERS_PER_TASK)
    p, g, m, v = parameter[start:stop], gradient[start:stop], first[start:stop], second[start:stop]
    adam_row(p, g, m, v, rate, root, beta1, beta2, epsilon)


_adam_kernel = jit(_adam)
