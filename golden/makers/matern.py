"""Family `matern`: equation (4), the Matern weights rho and the penalty on the motion coefficients.

Frequencies, coefficients and a correlation length come in. The lengths are the published one, 0 (all weights alike) and
a long one (weights like omega^6); they fix the mean 1 of the weights, the factor 2 pi, the power, and the order of the
weights along the atoms.
"""

from makers.clock import omegas
from makers.copies import Edit
from makers.making import Seeds, Spec, scalar
from makers.wrong import edit, port

OPERATIONS = ("matern",)


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


# ---- mistakes ----

SOURCE = "equations.matern"


def _power(power: str) -> tuple[Edit, ...]:
    return (
        edit(SOURCE, "(1.0 + small)) ** 3", f"(1.0 + small)) ** {power}"),
        edit(SOURCE, "(5.0 + scaled**2)) ** 3", f"(5.0 + scaled**2)) ** {power}"),
    )


WRONG_PORTS = [
    port(
        "matern_sum_one",
        "Matern weights scaled to sum 1",
        "sum; right: mean 1",
        "matern",
        edit(SOURCE, "(math.fsum(density) / density.size)", "math.fsum(density)"),
    ),
    port(
        "matern_inverted",
        "Spectral density itself as weight",
        "low frequencies pay; right: high ones",
        "matern",
        *_power("-3"),
    ),
    port(
        "matern_without_two_pi",
        "Matern weights of w in place of 2 pi w",
        "5/l^2 + w^2; right: (2 pi w)^2",
        "matern",
        edit(SOURCE, "length * (2.0 * np.pi * float(wide.max()))", "length * float(wide.max())"),
    ),
    port(
        "matern_wrong_power", "Power of Matern-3/2 or 5/2 in place of 3", "^(5/2); right: ^3", "matern", *_power("2.5")
    ),
    port(
        "penalty_over_two",
        "Penalty over 2 N F",
        "sum over axes; right: 1 / (6 N F)",
        "matern",
        edit(SOURCE, "(6.0 * n * count)", "(2.0 * n * count)"),
        edit(SOURCE, "(3.0 * max(count, 1) * rho.size)", "(1.0 * max(count, 1) * rho.size)"),
    ),
    port(
        "penalty_gradient_without_two",
        "Gradient of the penalty without its 2",
        "rho C; right: 2 rho C",
        "matern",
        edit(SOURCE, "(3.0 * max(count, 1) * rho.size)", "(6.0 * max(count, 1) * rho.size)"),
    ),
    port(
        "penalty_interleaved",
        "Weights of interleaved atoms in the penalty",
        "rho repeated pairwise; right: rho for the sines, then for the cosines",
        "matern",
        edit(SOURCE, "sums.reshape(axes, 2, count).sum(axis=(0, 1))", "sums.reshape(axes, count, 2).sum(axis=(0, 2))"),
        edit(SOURCE, "np.tile(factor, 2)", "np.repeat(factor, 2)"),
    ),
]
