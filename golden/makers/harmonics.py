"""Family `harmonics`: the colour of a Gaussian (B4) from harmonics of degree 0 to 3 and its residual.

Inputs: coefficients, residual, position, optical centre and the gradient with respect to the colour. The cases test the
signs and the order of the coefficients, the clamp at 0 (none at 1), the gradient through the view direction, and a
Gaussian at the optical centre, which has no direction.
"""

from makers.making import Seeds, Spec, changed
from makers.operations import PER_LENGTH, Declared, Judged

DECLARED = {
    "harmonics": Declared(
        {
            "colour": Judged(1, "display", oracle="harmonics.harmonics_forward"),
            "d_harmonics": Judged(2, "loss"),
            "d_residual": Judged(2, "loss"),
            "d_position": Judged(2, PER_LENGTH),
            "d_centre": Judged(2, PER_LENGTH),
        },
        "`residual` is added to coefficient 0; `centre` is the optical centre",
    )
}
OPERATIONS = tuple(DECLARED)


def _degree(degree: int) -> Spec:
    seeds = Seeds("harmonics", f"degree_{degree}")
    coefficients = seeds.uniform("harmonics", -0.4, 0.6, (degree + 1) ** 2, 3, 9)
    coefficients = changed(coefficients, (0, slice(None), slice(None, None, 3)), -4.0, "[0, :, ::3] is -4: clamped")
    coefficients = changed(coefficients, (0, 1, slice(1, None, 3)), 4.0, "[0, 1, 1::3] is 4: above 1")
    inputs = {
        "harmonics": coefficients,
        "residual": seeds.uniform("residual", -0.3, 0.3, 3, 9),
        "position": seeds.uniform("position", -2.0, 2.0, 3, 9, unit="scene unit"),
        "centre": seeds.uniform("centre", -0.3, 0.3, 3, unit="scene unit"),
        "d_colour": seeds.uniform("d_colour", -1.0, 1.0, 3, 9),
    }
    flags = [
        "colour_not_clamped",
        "colour_clamped_above",
        "offset_half_missing",
        "residual_not_scaled",
        "colour_clamp_gradient_passed",
    ]
    if degree > 0:
        flags += [
            "harmonics_sign_y",
            "direction_gradient_dropped",
            "direction_inverted",
            "bands_channel_first",
            "harmonics_x_and_y_swapped",
            "direction_gradient_not_projected",
        ]
    title = f"Real harmonics of degree {degree}; residual on the first coefficient, clamp at 0, none above"
    return Spec("harmonics", f"degree_{degree}", "harmonics", title, tuple(flags), {"degree": degree}, inputs)


def _at_the_camera() -> Spec:
    seeds = Seeds("harmonics", "at_the_camera")
    centre = seeds.uniform("centre", -0.3, 0.3, 3, unit="scene unit")
    position = seeds.uniform("position", -2.0, 2.0, 3, 4, unit="scene unit")
    inputs = {
        "harmonics": seeds.uniform("harmonics", -0.4, 0.6, 9, 3, 4),
        "residual": seeds.uniform("residual", -0.3, 0.3, 3, 4),
        "position": changed(position, (slice(None), 1), centre.array, "Gaussian 1 is at the optical centre"),
        "centre": centre,
        "d_colour": seeds.uniform("d_colour", -1.0, 1.0, 3, 4),
    }
    return Spec("harmonics", "at_the_camera", "harmonics", "A Gaussian at the optical centre: the first band only",
                ("direction_of_nothing",), {"degree": 2}, inputs, ("position", "centre"), own=("colour",))  # fmt: skip


def cases() -> list[Spec]:
    """Every degree, and a Gaussian without a direction."""
    return [*(_degree(degree) for degree in range(4)), _at_the_camera()]
