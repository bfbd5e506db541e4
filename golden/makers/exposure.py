"""Family `exposure`: equation (B13), gain and bias of each colour channel of one frame.

Inputs: colours, logarithmic gains, biases and the gradient with respect to the exposed colours. The gains are on both
sides of 1. One case has exposed colours below 0 and the other above 1, which reveals a clamp at either end.
"""

from makers.making import Seeds, Spec
from makers.operations import Declared, Judged

DECLARED = {
    "exposure": Declared(
        {
            "exposed": Judged(1, "display", oracle="exposure.exposure_forward"),
            "d_colour": Judged(2, "loss per display", oracle="exposure.exposure_reverse"),
            "d_log_gain": Judged(2, "loss", oracle="exposure.exposure_reverse"),
            "d_bias": Judged(2, "loss per display", oracle="exposure.exposure_reverse"),
        },
        "gain and bias of each channel; nothing is clamped. `objective` and `training` use it in one case each",
        free={
            "optimiser.exposure": "a rate of an option that is off in every preset; one trajectory has a value of its"
            " own"
        },
    )
}
OPERATIONS = tuple(DECLARED)


def cases() -> list[Spec]:
    """A generic exposure, with exposed colours below 0, and a bright one, with most of them above 1."""
    return [_generic(), _bright()]


def _bright() -> Spec:
    seeds = Seeds("exposure", "bright")
    inputs = {
        "colour": seeds.uniform("colour", 0.25, 1.75, 3, 5, 7, unit="display"),
        "log_gain": seeds.uniform("log_gain", -0.125, 0.75, 3),
        "bias": seeds.uniform("bias", 0.0625, 0.25, 3, unit="display"),
        "d_exposed": seeds.uniform("d_exposed", -1.0, 1.0, 3, 5, 7),
    }
    flags = ("exposure_clamped",)
    return Spec("exposure", "bright", "exposure", "Exposed colours above 1 stay what they are", flags, {}, inputs)


def _generic() -> Spec:
    seeds = Seeds("exposure", "generic")
    inputs = {
        "colour": seeds.uniform("colour", -0.25, 1.25, 3, 6, 8, unit="display"),
        "log_gain": seeds.uniform("log_gain", -0.5, 0.5, 3),
        "bias": seeds.uniform("bias", -0.25, 0.25, 3, unit="display"),
        "d_exposed": seeds.uniform("d_exposed", -1.0, 1.0, 3, 6, 8),
    }
    flags = ("gain_not_exponential", "bias_before_gain", "exposure_clamped", "log_gain_gradient_by_gain")
    title = "exp(log_gain) colour + bias, not clamped"
    return Spec("exposure", "generic", "exposure", title, flags, {}, inputs)
