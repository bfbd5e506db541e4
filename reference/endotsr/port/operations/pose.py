"""Operation of the correction of a camera pose (B16)."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.method.equations import pose
from endotsr.port.operations.operation import Found, Inputs, Operation, Settings, Variant

ALWAYS_DOUBLE = "a pose is computed in float64, whatever the precision of its inputs"


def _pose(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    rotation, translation, saved = module.pose_forward(
        inputs["rotation"], inputs["translation"], inputs["rotation_vector"], inputs["offset"]
    )
    return {"corrected_rotation": rotation, "corrected_translation": translation}, saved


def _reverse(module: Any, cotangents: Inputs, saved: Any) -> Found:
    return module.pose_reverse(cotangents["corrected_rotation"], cotangents["corrected_translation"], saved)._asdict()


def _inputs(rng: np.random.Generator, angle: float) -> dict[str, NDArray]:
    """A rotation by `angle` rad; the given matrix is not a rotation: its nine entries are independent."""
    axis = rng.normal(0, 1, 3)
    return {
        "rotation": rng.normal(0, 1, (3, 3)),
        "translation": rng.normal(0, 2, 3),
        "rotation_vector": angle * axis / np.linalg.norm(axis),
        "offset": rng.normal(0, 1, 3),
    }


OPERATIONS = [
    Operation(
        name="pose",
        equation="B16",
        text="correction of a camera pose",
        function="endotsr.method.equations.pose.pose_forward",
        forward=partial(_pose, pose),
        reverse=partial(_reverse, pose),
        variants=(
            Variant("pose", lambda rng: _inputs(rng, 1.7), single=ALWAYS_DOUBLE),
            Variant("pose_small", lambda rng: _inputs(rng, 0.02), single=ALWAYS_DOUBLE),
        ),
    )
]
