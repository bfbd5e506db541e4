"""Equation (B10): Adam."""

import numpy as np

SMALLEST = 1.1754943508222875e-38  # a first moment of smaller absolute value becomes 0


def adam_state(parameters):
    """m = v = 0 and k = 0 for every array by name."""
    return {name: (np.zeros_like(array), np.zeros_like(array), 0) for name, array in parameters.items()}


def adam_step(parameter, gradient, first, second, step, learning_rate, beta1, beta2, epsilon):
    """Equation (B10): parameter, m and v after step k = 1, 2, ...; a rate may have the shape of the parameter."""
    m = beta1 * first + (1 - beta1) * gradient  # (13.1)
    v = beta2 * second + (1 - beta2) * gradient**2
    m = np.where(np.abs(m) < SMALLEST, 0, m)
    change = m / (1 - beta1**step) / (np.sqrt(v / (1 - beta2**step)) + epsilon)  # (13.2)
    return parameter - learning_rate * change, m, v


def adam_update(state, parameters, gradients, rates, beta1, beta2, epsilon):
    """New (state, parameters) after one step of the arrays that have a gradient; the others are unchanged.

    A rate is a number, or ((slice of the leading axis, rate), ...), as `learning_rates` gives it.
    """
    state = dict(state)
    parameters = dict(parameters)
    for name, gradient in gradients.items():
        m, v, k = state[name]
        rate = np.zeros(len(gradient))
        for part, value in rates[name] if isinstance(rates[name], tuple) else ((slice(None), rates[name]),):
            rate[part] = value
        rate = rate.reshape(-1, *[1] * (gradient.ndim - 1))
        parameters[name], m, v = adam_step(parameters[name], gradient, m, v, k + 1, rate, beta1, beta2, epsilon)
        state[name] = m, v, k + 1
    return state, parameters
