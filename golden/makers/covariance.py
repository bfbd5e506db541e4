"""Family `covariance`: rotation and semi-axes of a Gaussian (B2) from its raw quaternion and log-scale.

Inputs: quaternions of any length, log-scales, and gradients with respect to rotation and scale. The cases test the
order w, x, y, z, the normalisation and its gradient, short quaternions, the zero one (the identity, gradient 0) and the
clip of a log-scale at +-40.
"""

from makers.making import Made, Seeds, Spec, changed, given
from makers.operations import Declared, Judged

DECLARED = {
    "covariance": Declared(
        {
            "rotation": Judged(1, "1", "last", "covariance.rotation_of"),
            "scale": Judged(1, "scene unit", "last"),
            "d_quaternion": Judged(2, "loss", "last"),
            "d_log_scale": Judged(2, "loss", "last"),
        },
        "`rotation` (3, 3, N) of the normalised quaternion, `scale` = exp(log_scale), and back",
    )
}
OPERATIONS = tuple(DECLARED)


def _generic(seeds: Seeds, count: int) -> dict[str, Made]:
    return {
        "quaternion": seeds.uniform("quaternion", -2.0, 2.0, 4, count),
        "log_scale": seeds.uniform("log_scale", -1.0, 1.0, 3, count),
        "d_rotation": seeds.uniform("d_rotation", -1.0, 1.0, 3, 3, count),
        "d_scale": seeds.uniform("d_scale", -1.0, 1.0, 3, count),
    }


def cases() -> list[Spec]:
    """Raw quaternions, short ones, a zero one, clipped log-scales."""
    generic = _generic(Seeds("covariance", "generic"), 6)
    zero = generic | {"quaternion": changed(generic["quaternion"], (slice(None), 2), 0.0, "quaternion 2 is 0")}
    short = _generic(Seeds("covariance", "short_quaternion"), 4)
    lengths = [2.0**-14, 2.0**-30, 2.0**-60, 2.0**20]
    short["quaternion"] = given([[length * entry for length in lengths] for entry in (1.0, -2.0, 1.0, 2.0)],
                                "(1, -2, 1, 2) times 2^-14, 2^-30, 2^-60 and 2^20")  # fmt: skip
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
        Spec("covariance", "short_quaternion", "covariance", "A quaternion has a direction at any length above 0",
             ("short_quaternion_as_zero", "epsilon_added_to_norm"), {}, short, ("quaternion",)),
        Spec("covariance", "clipped_log_scale", "covariance", "A log-scale is clipped to +-40, gradient 0",
             ("log_scale_not_clipped", "log_scale_gradient_through_clip", "log_scale_gradient_zero_on_limit"), {},
             clipped,
             ("log_scale",)),
    ]  # fmt: skip
