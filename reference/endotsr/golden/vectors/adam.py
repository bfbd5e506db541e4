"""Family `adam`: the optimiser (B10) for some steps with given gradients.

A parameter and one gradient a step come in. The cases fix the bias correction, the place and size of epsilon with tiny
gradients, and that a second moment of 0 moves nothing.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Made, Seeds, Spec, changed
from endotsr.golden.vectors.wrong import Request, WrongPort

OPERATIONS = ("adam",)


def _spec(case: str, title: str, flags: tuple[str, ...], parameter: Made, gradients: Made) -> Spec:
    settings = {"rate": 0.005, "beta1": 0.9, "beta2": 0.999, "epsilon": 1e-15}
    return Spec("adam", case, "adam", title, flags, settings, {"parameter": parameter, "gradients": gradients})


def _three_steps() -> Spec:
    seeds = Seeds("adam", "three_steps")
    gradients = seeds.uniform("gradients", -1.0, 1.0, 3, 4, 5)
    gradients = changed(gradients, (slice(None), 0), gradients.array[:, 0] * 2.0**-24, "[:, 0] times 2^-24")
    gradients = changed(gradients, (slice(None), 3, 4), 0.0, "[:, 3, 4] is 0")
    flags = ("adam_without_bias_correction", "adam_epsilon_in_root", "adam_epsilon_1e-8", "adam_first_step_zero")
    return _spec("three_steps", "Bias correction, epsilon outside the root, a tiny gradient", flags,
                 seeds.uniform("parameter", -1.0, 1.0, 4, 5), gradients)  # fmt: skip


def _zero_moment() -> Spec:
    seeds = Seeds("adam", "zero_moment")
    gradients = seeds.uniform("gradients", -1.0, 1.0, 2, 3, 4)
    gradients = changed(gradients, (slice(None), 1), 0.0, "[:, 1] is 0: both moments are 0")
    gradients = changed(gradients, (0, 2), 0.0, "[0, 2] is 0: the moments begin at the second step")
    return _spec("zero_moment", "A second moment of 0 moves nothing", ("adam_zero_over_zero",),
                 seeds.uniform("parameter", -1.0, 1.0, 3, 4), gradients)  # fmt: skip


def cases() -> list[Spec]:
    """Three steps, and gradients of 0."""
    return [_three_steps(), _zero_moment()]


# ---- mistakes ----


def _adam_with(root=lambda v, eps: np.sqrt(v) + eps, corrected=True, epsilon=None):
    def wrong(request: Request) -> dict[str, NDArray]:
        p = request.inputs["parameter"].copy()
        beta1, beta2 = request.settings["beta1"], request.settings["beta2"]
        eps = request.settings["epsilon"] if epsilon is None else epsilon
        m, v = np.zeros_like(p), np.zeros_like(p)
        for k, g in enumerate(request.inputs["gradients"], start=1):
            m, v = beta1 * m + (1 - beta1) * g, beta2 * v + (1 - beta2) * g * g
            mm, vv = (m / (1 - beta1**k), v / (1 - beta2**k)) if corrected else (m, v)
            p = p - request.settings["rate"] * mm / root(vv, eps)
        return {"parameter_after": p}

    return wrong


def _late_adam(request: Request) -> dict[str, NDArray]:
    inputs = dict(request.inputs) | {"gradients": request.inputs["gradients"][1:]}
    return request.run(inputs, request.settings)


def _zero_over_zero(request: Request) -> dict[str, Any] | None:
    """An update m / sqrt(v) without epsilon."""
    nothing = request.right["second"] == 0
    return {"parameter_after": np.where(nothing, np.nan, request.right["parameter_after"])} if nothing.any() else None


WRONG_PORTS = [
    WrongPort("adam_without_bias_correction", "Adam without bias correction", "m / sqrt(v); right: corrected",
              {"adam": _adam_with(corrected=False)}),
    WrongPort("adam_epsilon_in_root", "Epsilon inside the root", "sqrt(v + eps); right: sqrt(v) + eps",
              {"adam": _adam_with(lambda v, eps: np.sqrt(v + eps))}),
    WrongPort("adam_epsilon_1e-8", "Adam's usual epsilon", "1e-8; right: 1e-15", {"adam": _adam_with(epsilon=1e-8)}),
    WrongPort("adam_first_step_zero", "First gradient not stepped on", "one step late; right: k counts from 1",
              {"adam": _late_adam}),
    WrongPort("adam_zero_over_zero", "Step of a zero gradient", "0 / 0; right: 0 over epsilon",
              {"adam": _zero_over_zero}),
]  # fmt: skip
