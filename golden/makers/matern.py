"""Family `matern`: equation (4), the Matern weights rho and the penalty on the motion coefficients.

Inputs: frequencies, coefficients and a correlation length. The lengths are the published one, 0 (equal weights) and a
long one (weights proportional to omega^6). They test the mean 1 of the weights, the factor 2 pi, the power, and the
order of the weights along the atoms.
"""

from makers.clock import omegas
from makers.making import Seeds, Spec, scalar
from makers.operations import Declared, Judged

DECLARED = {
    "matern": Declared(
        {
            "rho": Judged(1, oracle="matern_oracle.weights"),
            "penalty": Judged(1, "scene unit^2", oracle="matern.matern_penalty_forward"),
            "d_motion_coefficients": Judged(2, "loss per scene unit", oracle="matern.matern_penalty_reverse"),
        },
        "weights, penalty, gradient for `d_penalty`",
        settings={"correlation_length": "model.correlation_length"},
    )
}
OPERATIONS = tuple(DECLARED)


def cases() -> list[Spec]:
    """Three correlation lengths."""
    everything = ("matern_sum_one", "matern_inverted", "matern_without_two_pi", "matern_wrong_power",
                  "penalty_over_two", "penalty_gradient_without_two", "penalty_interleaved")  # fmt: skip
    out = []
    for case, length, count, title, flags in (
        ("published", 0.2, 8, "Weights of mean 1, penalty over 6 N F", everything),
        ("short", 0.0, 4, "l = 0 weighs all alike", ("penalty_over_two", "matern_sum_one")),
        ("long", 5.0, 4, "A long correlation weighs like omega^6",
         ("matern_sum_one", "matern_inverted", "matern_wrong_power", "penalty_over_two")),
    ):  # fmt: skip
        seeds = Seeds("matern", case)
        inputs = {
            "omega": omegas(count),
            "motion_coefficients": seeds.uniform("motion_coefficients", -0.5, 0.5, 3, 2 * count, 6, unit="scene unit"),
            "d_penalty": scalar(1.5),
        }
        out.append(Spec("matern", case, "matern", title, flags, {"correlation_length": length}, inputs))
    return out
