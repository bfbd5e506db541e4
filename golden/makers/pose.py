"""Family `pose`: equation (B16), a rotation and a translation on top of a camera pose.

A matrix, a translation, the rotation vector, the offset, and the gradients by the corrected pose come in. The matrix is
no rotation, since its nine entries are independent. One case turns by more than a right angle, the other one by an
angle at which the closed forms lose digits.
"""

from makers.making import Made, Seeds, Spec
from makers.wrong import edit, port

OPERATIONS = ("pose",)


def cases() -> list[Spec]:
    """A wide and a small rotation."""
    angles = {"wide": (1.5, "a wide rotation"), "small": (2e-3, "a small rotation")}
    return [_case(name, largest, title) for name, (largest, title) in angles.items()]


def pose_inputs(name: str, largest: float) -> dict[str, Made]:
    """A pose, a rotation vector with entries up to `largest`, and gradients."""
    seeds = Seeds("pose", name)
    return {
        "rotation": seeds.uniform("rotation", -1.0, 1.0, 3, 3),
        "translation": seeds.uniform("translation", -2.0, 2.0, 3, unit="scene"),
        "rotation_vector": seeds.uniform("rotation_vector", 0.5 * largest, largest, 3, unit="rad"),
        "offset": seeds.uniform("offset", -1.0, 1.0, 3, unit="scene"),
        "d_corrected_rotation": seeds.uniform("d_corrected_rotation", -1.0, 1.0, 3, 3),
        "d_corrected_translation": seeds.uniform("d_corrected_translation", -1.0, 1.0, 3),
    }


def _case(name: str, largest: float, title: str) -> Spec:
    shown = FLAGS if name == "wide" else FLAGS[:-1]  # the factors hardly change with a small angle
    return Spec("pose", name, "pose", title, shown, {}, pose_inputs(name, largest))


# ---- mistakes ----

SOURCE = "equations.pose"
FLAGS = ("rotation_vector_reversed", "rotation_after_pose", "offset_before_rotation", "radial_gradient_dropped")
SUM = "np.eye(3) + a * k + b * (k @ k)"
MOVED = "exponential @ w, exponential @ d + offset,"

WRONG_PORTS = [
    port(
        "rotation_vector_reversed",
        "Rotation by the negative angle",
        "Exp(-rotation_vector); right: Exp(rotation_vector)",
        "pose",
        edit(SOURCE, SUM, "np.eye(3) - a * k + b * (k @ k)"),
        edit(SOURCE, "(a1 * k + b1 * (k @ k))", "(-a1 * k + b1 * (k @ k))"),
        edit(SOURCE, "d_k = a * d_exponential +", "d_k = -a * d_exponential +"),
    ),
    port(
        "rotation_after_pose",
        "Rotation in world axes",
        "rotation E; right: E rotation",
        "pose",
        edit(SOURCE, MOVED, "w @ exponential, exponential @ d + offset,"),
        edit(
            SOURCE,
            "d_exponential = d_w @ saved.rotation.T + np.outer(d_d, saved.translation)",
            "d_exponential = saved.rotation.T @ d_w + np.outer(d_d, saved.translation)",
        ),
        edit(SOURCE, "PoseGrads(saved.exponential.T @ d_w,", "PoseGrads(d_w @ saved.exponential.T,"),
    ),
    port(
        "offset_before_rotation",
        "Offset added before the rotation",
        "E (translation + offset); right: E translation + offset",
        "pose",
        edit(SOURCE, MOVED, "exponential @ w, exponential @ (d + offset),"),
        edit(SOURCE, "PoseSaved(w, d, vector, exponential)", "PoseSaved(w, d + offset, vector, exponential)"),
        edit(SOURCE, "d_vector, d_d.copy())", "d_vector, saved.exponential.T @ d_d)"),
    ),
    port(
        "radial_gradient_dropped",
        "Gradient by the angle dropped",
        "the factors of the exponential taken as constants; right: differentiated too",
        "pose",
        edit(SOURCE, "d_k, 2) + radial * v", "d_k, 2)"),
    ),
]
