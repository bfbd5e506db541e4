"""Family `motion`: equation (3), the translation C phi.

Inputs: coefficients C, raw atoms and the gradient with respect to the translation. One case suffices: the operation is
linear, and its only possible mistake is to omit sines or cosines.
"""

from makers.making import Seeds, Spec
from makers.operations import Declared, Judged

DECLARED = {
    "motion": Declared(
        {
            "translation": Judged(1, "scene unit", oracle="motion.motion_forward"),
            "d_motion_coefficients": Judged(2, "loss per scene unit", "last", "motion.motion_reverse"),
            "d_phi": Judged(2, "loss", oracle="motion.motion_reverse"),
        },
        "atoms are given",
    )
}
OPERATIONS = tuple(DECLARED)


def cases() -> list[Spec]:
    """A generic translation."""
    seeds = Seeds("motion", "generic")
    inputs = {
        "motion_coefficients": seeds.uniform("motion_coefficients", -0.5, 0.5, 3, 6, 7, unit="scene unit"),
        "phi": seeds.uniform("phi", -1.0, 1.0, 6),
        "d_translation": seeds.uniform("d_translation", -1.0, 1.0, 3, 7),
    }
    return [Spec("motion", "generic", "motion", "Translation C phi", ("motion_cosines_dropped",), {}, inputs)]
