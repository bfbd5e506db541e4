"""Family `exposure`: equation (B13), gain and bias of each colour channel of one frame.

Colours, logarithmic gains, biases and a gradient by the exposed colours come in. The gains lie on both sides of 1, and
colours leave the range [0, 1], so that a clamp shows.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Seeds, Spec
from endotsr.golden.vectors.wrong import Request, WrongPort

OPERATIONS = ("exposure",)


def cases() -> list[Spec]:
    """A generic exposure, with colours below 0 and above 1."""
    seeds = Seeds("exposure", "generic")
    inputs = {
        "colour": seeds.uniform("colour", -0.25, 1.25, 3, 6, 8, unit="display"),
        "log_gain": seeds.uniform("log_gain", -0.5, 0.5, 3),
        "bias": seeds.uniform("bias", -0.25, 0.25, 3, unit="display"),
        "d_exposed": seeds.uniform("d_exposed", -1.0, 1.0, 3, 6, 8),
    }
    flags = ("gain_not_exponential", "bias_before_gain", "exposure_clamped", "log_gain_gradient_by_gain")
    title = "exp(log_gain) colour + bias, not clamped"
    return [Spec("exposure", "generic", "exposure", title, flags, {}, inputs)]


# ---- mistakes ----


def _with_gain(request: Request, gain: NDArray, d_gain: NDArray, bias_gain: NDArray) -> dict[str, NDArray]:
    """Exposed colours gain colour + bias_gain bias, and their derivatives; d_gain is that of the gain by log_gain."""
    colour, bias, up = (request.inputs[name] for name in ("colour", "bias", "d_exposed"))
    column = lambda a: a[:, None, None]
    return {
        "exposed": column(gain) * colour + column(bias_gain * bias),
        "d_colour": column(gain) * up,
        "d_log_gain": d_gain * (up * (colour + column((bias_gain != 1) * bias))).sum(axis=(1, 2)),
        "d_bias": bias_gain * up.sum(axis=(1, 2)),
    }


def _linear_gain(request: Request) -> dict[str, NDArray]:
    """1 + log_gain in place of its exponential."""
    ones = np.ones(3)
    return _with_gain(request, 1 + request.inputs["log_gain"], ones, ones)


def _bias_first(request: Request) -> dict[str, NDArray]:
    """exp(log_gain) (colour + bias)."""
    gain = np.exp(request.inputs["log_gain"])
    return _with_gain(request, gain, gain, gain)


def _clamped(request: Request) -> dict[str, NDArray]:
    """The exposed colours limited to [0, 1], in value and gradient."""
    inside = (request.right["exposed"] >= 0) & (request.right["exposed"] <= 1)
    inputs = dict(request.inputs) | {"d_exposed": np.where(inside, request.inputs["d_exposed"], 0)}
    return request.run(inputs, request.settings) | {"exposed": np.clip(request.right["exposed"], 0, 1)}


def _by_gain(request: Request) -> dict[str, NDArray]:
    """The chain rule stops at the gain."""
    return {"d_log_gain": request.right["d_log_gain"] / np.exp(request.inputs["log_gain"])}


WRONG_PORTS = [
    WrongPort("gain_not_exponential", "Gain taken for its logarithm", "1 + log_gain; right: exp(log_gain)",
              {"exposure": _linear_gain}),
    WrongPort("bias_before_gain", "Bias added before the gain", "gain (colour + bias); right: gain colour + bias",
              {"exposure": _bias_first}),
    WrongPort("exposure_clamped", "Exposed colours clamped", "limited to [0, 1]; right: no clamp",
              {"exposure": _clamped}),
    WrongPort("log_gain_gradient_by_gain", "Gradient by the gain, not by its logarithm",
              "sum(g colour); right: times the gain",
              {"exposure": _by_gain}),
]  # fmt: skip
