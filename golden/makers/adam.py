"""Family `adam`: the optimiser (B10) for some steps with given gradients.

Inputs: a parameter and one gradient per step. The cases test the bias correction, the position and size of epsilon with
tiny gradients, and a second moment of 0, which moves nothing.
"""

from makers.making import Made, Seeds, Spec, changed
from makers.operations import Declared, Judged

DECLARED = {
    "adam": Declared(
        {"parameter_after": Judged(1, oracle="adam.adam_scalar"), "first": Judged(1), "second": Judged(1)},
        "one step for each of `gradients`, from zero moments; `first`, `second` = moments at the end, before bias"
        " correction",
        settings={name: f"optimiser.{name}" for name in ("beta1", "beta2", "epsilon")},
    )
}
OPERATIONS = tuple(DECLARED)


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
