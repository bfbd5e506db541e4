"""Family `pose`: equation (B16), a rotation and a translation on top of a camera pose.

Inputs: a matrix, a translation, the rotation vector, the offset, and the gradients with respect to the corrected pose.
The matrix is not a rotation: its nine entries are independent. One case rotates by more than a right angle, the other
by an angle at which the closed forms lose digits.
"""

from makers.making import Made, Seeds, Spec
from makers.operations import Declared, Judged

DECLARED = {
    "pose": Declared(
        {
            "corrected_rotation": Judged(1, oracle="pose_oracle.corrected"),
            "corrected_translation": Judged(1, "scene", oracle="pose_oracle.corrected"),
            "d_rotation": Judged(2, "loss", oracle="pose_oracle.gradients"),
            "d_translation": Judged(2, "loss per scene", oracle="pose_oracle.gradients"),
            "d_rotation_vector": Judged(2, "loss per rad", oracle="pose_oracle.gradients"),
            "d_offset": Judged(2, "loss per scene", oracle="pose_oracle.gradients"),
        },
        "`rotation` need not be one: its nine entries are independent, and so are those of `d_rotation`",
        free={
            "model.pose_correction": "an option that is off in every preset; its equation has a family of its own",
            "optimiser.pose": "a rate of that option",
        },
    )
}
OPERATIONS = tuple(DECLARED)
FLAGS = ("rotation_vector_reversed", "rotation_after_pose", "offset_before_rotation", "radial_gradient_dropped")


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
