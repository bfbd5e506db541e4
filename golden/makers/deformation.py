"""Family `deformation`: the offsets of the flexible deformation model (B1) at one time, in both time bases.

Inputs: weights, centres, widths, a time and the gradient with respect to the offsets. The cases test the two bases, the
sign of a width, which affects only its gradient, and the floor of a squared width.
"""

import numpy as np

from makers.making import Seeds, Spec, changed, given, scalar
from makers.operations import Declared, Judged

DECLARED = {
    "deformation": Declared(
        {
            "offsets": Judged(1, "raw parameter", "last", "deformation.deformation_forward"),
            "d_fdm_weight": Judged(2, "loss per raw parameter", "last", "deformation.deformation_reverse"),
            "d_fdm_centre": Judged(2, "loss", "last", "deformation.deformation_reverse"),
            "d_fdm_width": Judged(2, "loss", "last", "deformation.deformation_reverse"),
            "d_t": Judged(2, "loss", oracle="deformation.deformation_reverse"),
        },
        "offsets at `t`",
        settings={"basis": "model.basis"},
        free={"model.deformation": "a rigid scene has no arrays of the deformation, and their absence says so"},
    )
}
OPERATIONS = tuple(DECLARED)


def cases() -> list[Spec]:
    """Both time bases, and widths of 0."""
    out = []
    shape, t = (10, 3, 5), 0.453125
    for basis in ("quartic", "gaussian"):
        seeds = Seeds("deformation", basis)
        centre = seeds.uniform("fdm_centre", 0.25, 0.65, *shape)
        inputs = {
            "fdm_weight": seeds.uniform("fdm_weight", -1.0, 1.0, *shape, unit="raw parameter"),
            "fdm_centre": centre,
            "fdm_width": changed(seeds.uniform("fdm_width", 0.08, 0.3, *shape), (slice(None), 1),
                                 -seeds.uniform("fdm_width", 0.08, 0.3, *shape).array[:, 1], "basis 1 negated"),
            "t": scalar(t),
            "d_offsets": seeds.uniform("d_offsets", -1.0, 1.0, 10, 5),
        }  # fmt: skip
        flags = ("basis_swapped", "width_without_floor", "width_gradient_of_size", "time_gradient_sign",
                 *(("basis_gaussian_without_half",) if basis == "gaussian" else ()))  # fmt: skip
        title = f"The {basis} time basis; the sign of a width does not matter, its gradient has it"
        out.append(Spec("deformation", basis, "deformation", title, flags, {"basis": basis}, inputs))
    seeds = Seeds("deformation", "width_zero")
    inputs = {
        "fdm_weight": seeds.uniform("fdm_weight", -1.0, 1.0, 10, 2, 3),
        "fdm_centre": given(np.full((10, 2, 3), 0.4921875), "63/128"),
        "fdm_width": given(np.zeros((10, 2, 3)), "0"),
        "t": scalar(0.5),
        "d_offsets": seeds.uniform("d_offsets", -1.0, 1.0, 10, 3),
    }
    out.append(Spec("deformation", "width_zero", "deformation", "A width of 0 is finite: its square has a floor",
                    ("width_without_floor",), {"basis": "quartic"}, inputs))  # fmt: skip
    return out
