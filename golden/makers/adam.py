"""Family `adam`: the optimiser (B10) for some steps with given gradients.

A parameter and one gradient a step come in. The cases fix the bias correction, the place and size of epsilon with tiny
gradients, and that a second moment of 0 moves nothing.
"""

from makers.making import Made, Seeds, Spec, changed
from makers.wrong import edit, port

OPERATIONS = ("adam",)


def _spec(case: str, title: str, flags: tuple[str, ...], parameter: Made, gradients: Made) -> Spec:
    settings = {"rate": 0.005, "beta1": 0.9, "beta2": 0.999, "epsilon": 1e-15}
    return Spec("adam", case, "adam", title, flags, settings, {"parameter": parameter, "gradients": gradients})


def _three_steps() -> Spec:
    seeds = Seeds("adam", "three_steps")
    gradients = seeds.uniform("gradients", -1.0, 1.0, 3, 4, 5)
    gradients = changed(gradients, (slice(None), 0), gradients.array[:, 0] * 2.0**-24, "[:, 0] times 2^-24")
    gradients = changed(gradients, (slice(None), 3, 4), 0.0, "[:, 3, 4] is 0")
    flags = (
        "adam_without_bias_correction",
        "adam_epsilon_in_root",
        "adam_epsilon_1e-8",
        "adam_first_step_zero",
        "adam_second_moment_uncorrected",
    )
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

SOURCE = "fitting.adam"

WRONG_PORTS = [
    port(
        "adam_without_bias_correction",
        "Adam without bias correction",
        "m / sqrt(v); right: corrected",
        "adam",
        edit(
            SOURCE,
            "return learning_rate / (1.0 - beta1**step), 1.0 / (1.0 - beta2**step) ** 0.5",
            "return learning_rate, 1.0",
        ),
    ),
    port(
        "adam_second_moment_uncorrected",
        "Bias correction of the first moment alone",
        "v; right: v / (1 - beta2^k)",
        "adam",
        edit(SOURCE, "(1.0 - beta1**step), 1.0 / (1.0 - beta2**step) ** 0.5", "(1.0 - beta1**step), 1.0"),
    ),
    port(
        "adam_epsilon_in_root",
        "Epsilon inside the root",
        "sqrt(v + eps); right: sqrt(v) + eps",
        "adam",
        edit(SOURCE, "(np.sqrt(v) * root + epsilon)", "np.sqrt(v * root * root + epsilon)"),
    ),
    port(
        "adam_epsilon_1e-8",
        "Adam's usual epsilon",
        "1e-8; right: 1e-15",
        "adam",
        edit(SOURCE, "real(rate), real(root), real(epsilon)", "real(rate), real(root), real(1e-8)"),
    ),
    port(
        "adam_first_step_zero",
        "First gradient not stepped on",
        "one step late; right: k counts from 1",
        "adam",
        edit(
            SOURCE,
            "        state.step[name] += 1\n        for part",
            '        if not state.step.setdefault(f"{name} began", 0):\n            state.step[f"{name} began"] = 1\n'
            "            continue\n        state.step[name] += 1\n        for part",
        ),
    ),
    port(
        "adam_zero_over_zero",
        "Step of a zero gradient",
        "0 / 0; right: 0 over epsilon",
        "adam",
        edit(SOURCE, "(np.sqrt(v) * root + epsilon)", "(np.sqrt(v) * root)"),
    ),
    port(
        "adam_epsilon_before_correction",
        "Epsilon added before the bias correction",
        "(sqrt(v) + eps) / sqrt(1 - beta2^k); right: eps added afterwards",
        "adam",
        edit(
            SOURCE,
            "rate, root, float(beta1), float(beta2), float(epsilon))",
            "rate, root, float(beta1), float(beta2), float(epsilon) * root)",
        ),
    ),
]
