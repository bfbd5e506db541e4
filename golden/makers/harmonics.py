"""Family `harmonics`: the colour of a Gaussian (B4) from harmonics of degree 0 to 3 and its residual.

Coefficients, residual, position, optical centre and a gradient by the colour come in. The cases fix the signs and the
order of the coefficients, the clamp at 0 (none at 1), the gradient through the view direction, and a Gaussian at the
optical centre, which has no direction.
"""

from makers.making import Seeds, Spec, changed
from makers.wrong import edit, port

OPERATIONS = ("harmonics",)


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


# ---- mistakes ----

SOURCE, FORMULAS = "splatting.harmonics", "splatting.harmonics_formulas"
BOTH = "harmonics render"
DIFFERENCE = "position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]"
ORDER = "np.ascontiguousarray(harmonics.reshape(3, len(harmonics), -1).transpose(1, 0, 2))"

WRONG_PORTS = [
    port(
        "harmonics_sign_y",
        "Sign of the first harmonic",
        "+y; right: -y",
        BOTH,
        edit(FORMULAS, "        -c1 * y,\n        c1 * z", "        c1 * y,\n        c1 * z"),
        edit(FORMULAS, "-c1 * g3, -c1 * g1, c1 * g2", "-c1 * g3, c1 * g1, c1 * g2"),
    ),
    port(
        "harmonics_x_and_y_swapped",
        "First band in the order x, z, y",
        "x, z, y; right: y, z, x",
        BOTH,
        edit(
            FORMULAS,
            "        -c1 * y,\n        c1 * z,\n        -c1 * x,",
            "        -c1 * x,\n        c1 * z,\n        -c1 * y,",
        ),
        edit(FORMULAS, "-c1 * g3, -c1 * g1, c1 * g2", "-c1 * g1, -c1 * g3, c1 * g2"),
    ),
    port(
        "direction_inverted",
        "Direction from Gaussian to camera",
        "inverted; right: camera to Gaussian",
        BOTH,
        edit(FORMULAS, DIFFERENCE, "centre[0] - position[0], centre[1] - position[1], centre[2] - position[2]"),
        edit(
            FORMULAS, "g_x, g_y, g_z = d_direction", "g_x, g_y, g_z = -d_direction[0], -d_direction[1], -d_direction[2]"
        ),
    ),
    port(
        "direction_gradient_dropped",
        "No gradient through the view direction",
        "0; right: kept",
        BOTH,
        edit(FORMULAS, "g_x, g_y, g_z = d_direction", "g_x, g_y, g_z = (0 * g for g in d_direction)"),
    ),
    port(
        "direction_gradient_not_projected",
        "Gradient of the direction without its projection",
        "g / distance; right: less its part along the direction",
        BOTH,
        edit(FORMULAS, "along = g_x * x + g_y * y + g_z * z", "along = 0 * g_x"),
    ),
    port(
        "bands_channel_first",
        "Harmonics as [channel, band]",
        "(3, K); right: (K, 3)",
        BOTH,
        edit(
            SOURCE,
            "    centre = np.ascontiguousarray(centre, dtype)\n",
            f"    harmonics = {ORDER}\n    centre = np.ascontiguousarray(centre, dtype)\n",
        ),
        edit(
            SOURCE,
            "    residual = None if saved.residual is None else d_residual\n",
            "    residual = None if saved.residual is None else d_residual\n"
            "    d_harmonics = np.ascontiguousarray(d_harmonics.transpose(1, 0, 2)).reshape(d_harmonics.shape)\n",
        ),
    ),
    port(
        "colour_not_clamped",
        "Colour not clamped at 0",
        "negative colours; right: max(0, .)",
        BOTH,
        edit(SOURCE, "= sums[_U64(item)] < zero", "= False"),
        edit(SOURCE, "max(sums[_U64(item)], zero)", "sums[_U64(item)]"),
    ),
    port(
        "colour_clamp_gradient_passed",
        "Gradient passes the clamp of the colour",
        "passed; right: 0 below 0",
        BOTH,
        edit(SOURCE, "= sums[_U64(item)] < zero", "= False"),
    ),
    port(
        "colour_clamped_above",
        "Colour clamped at 1",
        "min(1, .); right: no upper clamp",
        BOTH,
        edit(SOURCE, "= sums[_U64(item)] < zero", "= sums[_U64(item)] < zero or sums[_U64(item)] > 1"),
        edit(SOURCE, "max(sums[_U64(item)], zero)", "min(max(sums[_U64(item)], zero), 1)"),
    ),
    port(
        "offset_half_missing",
        "1/2 left out of the colour",
        "sum Y h; right: 1/2 + sum Y h",
        BOTH,
        edit(SOURCE, "half + y00 * sums", "y00 * sums"),
    ),
    port(
        "residual_not_scaled",
        "Residual added to the colour",
        "colour + r; right: Y00 (h_0 + r)",
        BOTH,
        edit(SOURCE, "+= residual[channel, _U64(start + item)]", "+= residual[channel, _U64(start + item)] / y00"),
        edit(SOURCE, "d_residual[channel, _U64(start + item)] = y00 *", "d_residual[channel, _U64(start + item)] ="),
    ),
    port(
        "direction_of_nothing",
        "Direction to a Gaussian at the optical centre",
        "0 / 0; right: first band only",
        "harmonics",
        edit(
            FORMULAS, "one / distance if distance > zero else zero", "one / distance if distance > zero else math.inf"
        ),
    ),
]
