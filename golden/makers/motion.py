"""Family `motion`: equation (3), the translation C phi.

Coefficients C, raw atoms and a gradient by the translation come in. One case: the stage is linear, and its only choice
is that sines and cosines both take part.
"""

from makers.making import Seeds, Spec

OPERATIONS = ("motion",)


def cases() -> list[Spec]:
    """A generic translation."""
    seeds = Seeds("motion", "generic")
    inputs = {
        "motion_coefficients": seeds.uniform("motion_coefficients", -0.5, 0.5, 3, 6, 7, unit="scene unit"),
        "phi": seeds.uniform("phi", -1.0, 1.0, 6),
        "d_translation": seeds.uniform("d_translation", -1.0, 1.0, 3, 7),
    }
    return [Spec("motion", "generic", "motion", "Translation C phi", ("motion_cosines_dropped",), {}, inputs)]
