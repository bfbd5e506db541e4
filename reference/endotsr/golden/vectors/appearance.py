"""Family `appearance`: equation (2), the bounded colour residual beta tanh(A phi_bar) / Y00.

Coefficients A, normalised atoms and a gradient by the residual come in. The cases separate the factor 1 / Y00 from the
bound, show that zero coefficients still have a gradient, and saturate the tanh.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Seeds, Spec
from endotsr.golden.vectors.wrong import Request, WrongPort, scaled
from endotsr.kernels.constants import Y00

OPERATIONS = ("appearance",)


def cases() -> list[Spec]:
    """Coefficients of three sizes."""
    out = []
    for case, size, title, flags in (
        ("generic", 0.4, "beta tanh(A phi_bar) / Y00", ("missing_y00", "tanh_missing")),
        ("zero", 0.0, "Zero coefficients: no residual, but a gradient", ("zero_coefficients_zero_gradient",)),
        ("saturated", 4.0, "A saturated residual keeps its bound and its derivative",
         ("tanh_missing", "missing_y00")),
    ):  # fmt: skip
        seeds = Seeds("appearance", case)
        inputs = {
            "appearance_coefficients": seeds.uniform("colour_coefficients", -size, size, 3, 6, 7),
            "phi_bar": seeds.uniform("phi_bar", -1.5, 1.5, 6),
            "d_residual": seeds.uniform("d_residual", -1.0, 1.0, 3, 7),
        }
        out.append(Spec("appearance", case, "appearance", title, flags, {"beta": 0.3}, inputs))
    return out


# ---- mistakes ----


def _not_bounded(request: Request) -> dict[str, NDArray]:
    a, atoms, d = (request.inputs[n] for n in ("appearance_coefficients", "phi_bar", "d_residual"))
    scale = request.settings["beta"] / Y00
    return {
        "residual": scale * np.einsum("cai,a->ci", a, atoms),
        "d_appearance_coefficients": scale * np.einsum("ci,a->cai", d, atoms),
        "d_phi_bar": scale * np.einsum("ci,cai->a", d, a),
    }


WRONG_PORTS = [
    WrongPort("missing_y00", "1 / Y00 missing in the colour residual", "beta tanh; right: beta tanh / Y00",
              {"appearance": scaled(Y00, "residual", "d_appearance_coefficients", "d_phi_bar"),
               "scene": scaled(Y00, "residual_at_t")}),
    WrongPort("tanh_missing", "Colour residual not bounded", "beta A phi_bar; right: beta tanh(A phi_bar)",
              {"appearance": _not_bounded}),
    WrongPort("zero_coefficients_zero_gradient", "No gradient to zero coefficients",
              "component skipped while it is 0; right: its gradient starts it",
              {"appearance": lambda r: {"d_appearance_coefficients": 0 * r.right["d_appearance_coefficients"]}
               if not r.inputs["appearance_coefficients"].any() else None}),
]  # fmt: skip
