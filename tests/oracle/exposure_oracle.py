"""Equation (B13) pixel by pixel, and the derivatives of a weighted sum of the exposed colours."""

import math


def exposed(colour, log_gain, bias):
    """Nested lists [channel][row][column] of exp(log_gain) colour + bias."""
    return [
        [[math.exp(g) * value + b for value in row] for row in plane]
        for plane, g, b in zip(colour, log_gain, bias, strict=True)
    ]


def gradients(colour, log_gain, d_exposed):
    """Derivatives of sum(d_exposed x exposed) by colour, log_gain and bias."""
    d_colour, d_log_gain, d_bias = [], [], []
    for plane, g, weights in zip(colour, log_gain, d_exposed, strict=True):
        gain = math.exp(g)
        d_colour.append([[gain * w for w in row] for row in weights])
        flat, values = [w for row in weights for w in row], [value for row in plane for value in row]
        d_log_gain.append(math.fsum(w * gain * v for w, v in zip(flat, values, strict=True)))
        d_bias.append(math.fsum(flat))
    return d_colour, d_log_gain, d_bias


def at_time(t, times, values):
    """Linear between the neighbours of t among ascending times, constant beyond the ends."""
    if t <= times[0]:
        return values[0]
    for left in range(len(times) - 1):
        if t <= times[left + 1]:
            part = (t - times[left]) / (times[left + 1] - times[left])
            return values[left] + part * (values[left + 1] - values[left])
    return values[-1]
