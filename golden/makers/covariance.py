"""Family `covariance`: rotation and semi-axes of a Gaussian (B2) from its raw quaternion and log-scale.

Quaternions of any length, log-scales and gradients by rotation and scale come in. The cases fix the order w, x, y, z,
the normalisation and its gradient, the zero quaternion (the identity, gradient 0) and the clip of a log-scale at +-40.
"""

from makers.making import Made, Seeds, Spec, changed, given
from makers.wrong import edit, port

OPERATIONS = ("covariance",)


def _generic(seeds: Seeds, count: int) -> dict[str, Made]:
    return {
        "quaternion": seeds.uniform("quaternion", -2.0, 2.0, 4, count),
        "log_scale": seeds.uniform("log_scale", -1.0, 1.0, 3, count),
        "d_rotation": seeds.uniform("d_rotation", -1.0, 1.0, 3, 3, count),
        "d_scale": seeds.uniform("d_scale", -1.0, 1.0, 3, count),
    }


def cases() -> list[Spec]:
    """Raw quaternions, a zero one, clipped log-scales."""
    generic = _generic(Seeds("covariance", "generic"), 6)
    zero = generic | {"quaternion": changed(generic["quaternion"], (slice(None), 2), 0.0, "quaternion 2 is 0")}
    clipped = _generic(Seeds("covariance", "clipped_log_scale"), 5)
    clipped["log_scale"] = given([[60.0, 1.0, -60.0, 41.0, 40.0], [2.0, -41.0, 1.0, 39.0, 1.0],
                                  [0.5, 3.0, -2.0, -39.0, -40.0]],
                                 "(60, 2, 1/2), (1, -41, 3), (-60, 1, -2), (41, 39, -39), (40, 1, -40)")  # fmt: skip
    flags = ("quaternion_xyzw", "quaternion_not_normalised", "quaternion_gradient_without_norm",
             "quaternion_gradient_not_divided", "rotation_transposed",
             "scale_gradient_without_scale", "scale_is_variance")  # fmt: skip
    return [
        Spec("covariance", "generic", "covariance", "Raw quaternions w, x, y, z of any length", flags, {}, generic),
        Spec("covariance", "zero_quaternion", "covariance", "A zero quaternion is the identity, gradient 0",
             ("zero_quaternion",), {}, zero, ("quaternion",), own=("rotation",)),
        Spec("covariance", "clipped_log_scale", "covariance", "A log-scale is clipped to +-40, gradient 0",
             ("log_scale_not_clipped", "log_scale_gradient_through_clip", "log_scale_gradient_zero_on_limit"), {},
             clipped,
             ("log_scale",)),
    ]  # fmt: skip


# ---- mistakes ----

SOURCE = "splatting.covariance"
BOTH = "covariance render"
READ = "unit_quaternion(*column(quaternion, 4, "

WRONG_PORTS = [
    port(
        "quaternion_xyzw",
        "Quaternion read as x, y, z, w",
        "xyzw; right: w, x, y, z",
        BOTH,
        edit(SOURCE, READ + "start + item))", "unit_quaternion(*(quaternion[k, start + item] for k in (3, 0, 1, 2)))"),
        edit(SOURCE, READ + "i))", "unit_quaternion(*(quaternion[k, i] for k in (3, 0, 1, 2)))"),
        edit(SOURCE, "keep(results, item, d_q + d_s)", "keep(results, item, d_q[1:] + d_q[:1] + d_s)"),
    ),
    port(
        "quaternion_not_normalised",
        "Quaternion not normalised",
        "raw in the rotation; right: unit",
        BOTH,
        edit(SOURCE, "    w, x, y, z = w / largest", "    return w, x, y, z, one\n    w, x, y, z = w / largest"),
        edit(SOURCE, "    along = d_w", "    return d_unit\n    along = d_w"),
    ),
    port(
        "quaternion_gradient_without_norm",
        "Gradient of the normalisation left out",
        "by the unit quaternion; right: by the raw one",
        BOTH,
        edit(
            SOURCE,
            "unit_quaternion_reverse(w, x, y, z, inverse_norm, d_unit)\n            s,",
            "d_unit\n            s,",
        ),
    ),
    port(
        "quaternion_gradient_not_divided",
        "Gradient of the normalisation not divided by the norm",
        "projected only; right: projected and over the norm",
        BOTH,
        edit(
            SOURCE,
            "    along = d_w",
            "    inverse_norm = inverse_norm / inverse_norm if inverse_norm > 0 else inverse_norm\n    along = d_w",
        ),
    ),
    port(
        "zero_quaternion",
        "Zero quaternion divided by its norm",
        "not a number; right: identity, gradient 0",
        BOTH,
        edit(SOURCE, "return one, zero, zero, zero, zero", "return (real(math.nan),) * 5"),
    ),
    port(
        "rotation_transposed",
        "Rotation transposed",
        "R^T; right: R S S^T R^T",
        BOTH,
        edit(SOURCE, "keep(results, item, rotation_of(w, x, y, z))", "keep(results, item, rotation_of(w, -x, -y, -z))"),
        edit(
            SOURCE,
            "d_unit = rotation_reverse(w, x, y, z, column(d_rotation, 9, i))",
            "d_unit = rotation_reverse(w, -x, -y, -z, column(d_rotation, 9, i))\n"
            "            d_unit = d_unit[0], -d_unit[1], -d_unit[2], -d_unit[3]",
        ),
    ),
    port(
        "scale_gradient_without_scale",
        "Gradient of the exponential left out",
        "by s; right: times exp(s)",
        BOTH,
        edit(SOURCE, "return d_scale * scale if", "return d_scale if"),
    ),
    port(
        "scale_is_variance",
        "Scale taken as a variance",
        "exp(s / 2); right: exp(s) is the semi-axis",
        BOTH,
        edit(
            SOURCE,
            "exponential(min(max(log_scale, -limit), limit))",
            "exponential(min(max(log_scale, -limit), limit) / 2)",
        ),
        edit(SOURCE, "return d_scale * scale if", "return d_scale * scale / 2 if"),
    ),
    port(
        "log_scale_not_clipped",
        "Log-scale not clipped",
        "exp(s); right: s within +-40, gradient 0 beyond",
        "covariance",
        edit(SOURCE, "LOG_SCALE_LIMIT = 40.0", "LOG_SCALE_LIMIT = 700.0"),
    ),
    port(
        "log_scale_gradient_through_clip",
        "Gradient passes the clip of the log-scale",
        "passed; right: 0 beyond +-40",
        "covariance",
        edit(SOURCE, "d_scale * scale if inside", "d_scale * scale if inside or not inside"),
    ),
    port(
        "log_scale_gradient_zero_on_limit",
        "No gradient to a log-scale of exactly 40",
        "|s| < 40; right: |s| <= 40",
        "covariance",
        edit(SOURCE, "abs(log_scale) <= type", "abs(log_scale) < type"),
    ),
]
