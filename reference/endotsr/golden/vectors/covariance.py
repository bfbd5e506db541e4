"""Family `covariance`: rotation and semi-axes of a Gaussian (B2) from its raw quaternion and log-scale.

Quaternions of any length, log-scales and gradients by rotation and scale come in. The cases fix the order w, x, y, z,
the normalisation and its gradient, the zero quaternion (the identity, gradient 0) and the clip of a log-scale at +-40.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Made, Seeds, Spec, changed, given
from endotsr.golden.vectors.wrong import Request, Wrong, WrongPort, output, swapped

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
    clipped = _generic(Seeds("covariance", "clipped_log_scale"), 4)
    clipped["log_scale"] = given([[60.0, 1.0, -60.0, 41.0], [2.0, -41.0, 1.0, 39.0], [0.5, 3.0, -2.0, -39.0]],
                                 "(60, 2, 1/2), (1, -41, 3), (-60, 1, -2), (41, 39, -39)")  # fmt: skip
    flags = ("quaternion_xyzw", "quaternion_not_normalised", "quaternion_gradient_without_norm", "rotation_transposed",
             "scale_gradient_without_scale", "scale_is_variance")  # fmt: skip
    return [
        Spec("covariance", "generic", "covariance", "Raw quaternions w, x, y, z of any length", flags, {}, generic),
        Spec("covariance", "zero_quaternion", "covariance", "A zero quaternion is the identity, gradient 0",
             ("zero_quaternion",), {}, zero, ("quaternion",), own=("rotation",)),
        Spec("covariance", "clipped_log_scale", "covariance", "A log-scale is clipped to +-40, gradient 0",
             ("log_scale_not_clipped",), {}, clipped),
    ]  # fmt: skip


# ---- mistakes ----


def _xyzw(inputs: dict[str, NDArray]) -> dict[str, NDArray]:
    return {"quaternion": np.ascontiguousarray(inputs["quaternion"][[3, 0, 1, 2]])}


def _raw_rotation(q: NDArray) -> NDArray:
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _without_norm(request: Request) -> dict[str, NDArray]:
    """Gradient by the unit quaternion handed on as that by the raw one."""
    norm = np.sqrt((request.inputs["quaternion"] ** 2).sum(axis=0))
    return {"d_quaternion": request.right["d_quaternion"] * norm}


def _zero_quaternion(*names: str) -> Wrong:
    def wrong(request: Request) -> dict[str, NDArray] | None:
        zero = ~request.inputs["quaternion"].any(axis=0)
        if not zero.any():
            return None
        found = {}
        for name in names:
            value = request.right[name].copy()
            if value.shape[-1] == zero.size and name.startswith(("rotation", "d_")):
                value[..., zero] = np.nan
            else:
                value[...] = np.nan
            found[name] = value
        return found

    return wrong


def _not_clipped(request: Request) -> dict[str, NDArray]:
    scale = np.exp(request.inputs["log_scale"])
    return {"scale": scale, "d_log_scale": request.inputs["d_scale"] * scale}


WRONG_PORTS = [
    WrongPort("quaternion_xyzw", "Quaternion read as x, y, z, w", "xyzw; right: w, x, y, z",
              {"covariance": swapped(_xyzw), "render": swapped(_xyzw), "objective": swapped(_xyzw)}),
    WrongPort("quaternion_not_normalised", "Quaternion not normalised", "raw in the rotation; right: unit",
              {"covariance": lambda r: {"rotation": _raw_rotation(r.inputs["quaternion"].astype(float))}}),
    WrongPort("quaternion_gradient_without_norm", "Gradient of the normalisation left out",
              "by the unit quaternion; right: by the raw one", {"covariance": _without_norm}),
    WrongPort("zero_quaternion", "Zero quaternion divided by its norm", "not a number; right: identity, gradient 0",
              {"covariance": _zero_quaternion("rotation", "d_quaternion"),
               "render": _zero_quaternion("colour_image", "d_quaternion")}),
    WrongPort("rotation_transposed", "Rotation transposed", "R^T; right: R S S^T R^T",
              {"covariance": output(rotation=lambda a: np.ascontiguousarray(a.transpose(1, 0, 2)))}),
    WrongPort("scale_gradient_without_scale", "Gradient of the exponential left out", "by s; right: times exp(s)",
              {"covariance": lambda r: {"d_log_scale": r.inputs["d_scale"]}}),
    WrongPort("scale_is_variance", "Scale taken as a variance", "exp(s / 2); right: exp(s) is the semi-axis",
              {"covariance": lambda r: {"scale": np.exp(r.inputs["log_scale"] / 2)}}),
    WrongPort("log_scale_not_clipped", "Log-scale not clipped", "exp(s); right: s within +-40, gradient 0 beyond",
              {"covariance": _not_clipped}),
]  # fmt: skip
