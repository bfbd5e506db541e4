"""Family `appearance`: equation (2), the bounded colour residual beta tanh(A phi_bar) / Y00.

Inputs: coefficients A, normalised atoms and the gradient with respect to the residual. The cases distinguish the factor
1 / Y00 from the bound, have zero coefficients with a nonzero gradient, and saturate the tanh.
"""

from makers.making import Seeds, Spec
from makers.operations import Declared, Judged

DECLARED = {
    "appearance": Declared(
        {
            "residual": Judged(1, "display / Y00", oracle="appearance.appearance_forward"),
            "d_appearance_coefficients": Judged(2, "loss", "last", "appearance.appearance_reverse"),
            "d_phi_bar": Judged(2, "loss", oracle="appearance.appearance_reverse"),
        },
        "atoms are given",
        settings={"beta": "model.beta"},
    )
}
OPERATIONS = tuple(DECLARED)


def cases() -> list[Spec]:
    """Coefficients of three sizes."""
    out = []
    for case, size, title, flags in (
        ("generic", 0.4, "beta tanh(A phi_bar) / Y00", ("missing_y00", "tanh_missing")),
        ("zero", 0.0, "Zero coefficients: no residual, but a gradient", ("zero_coefficients_zero_gradient",)),
        ("saturated", 4.0, "A saturated residual keeps its bound and its derivative",
         ("tanh_missing", "missing_y00", "tanh_gradient_missing")),
    ):  # fmt: skip
        seeds = Seeds("appearance", case)
        inputs = {
            "appearance_coefficients": seeds.uniform("colour_coefficients", -size, size, 3, 6, 7),
            "phi_bar": seeds.uniform("phi_bar", -1.5, 1.5, 6),
            "d_residual": seeds.uniform("d_residual", -1.0, 1.0, 3, 7),
        }
        out.append(Spec("appearance", case, "appearance", title, flags, {"beta": 0.3}, inputs))
    return out
