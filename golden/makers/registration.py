"""Family `registration`: equation (B19), the residual of two frames that depth and a relative pose register.

Inputs: the relative pose, points of the source frame with their values, the picture of the target frame, and the
gradient with respect to the residuals. The points project into different pixels; one is behind the camera, and two are
nearer to an edge of the picture than the interpolation allows. The rotation is not one: its nine entries are
independent.
"""

import numpy as np

from makers.making import Made, Seeds, Spec, changed, given
from makers.operations import PER_LENGTH, Declared, Judged

FORWARD, REVERSE = "registration.registration_forward", "registration.registration_reverse"
DECLARED = {
    "registration": Declared(
        {
            "residual": Judged(1, "unit of the picture", oracle=FORWARD),
            "seen": Judged(1, scale="exact", oracle=FORWARD),
            "d_rotation": Judged(2, "loss", oracle=REVERSE),
            "d_translation": Judged(2, PER_LENGTH, oracle=REVERSE),
            "d_points": Judged(2, PER_LENGTH, oracle=REVERSE),
            "d_reference": Judged(2, "loss per unit of the picture", oracle=REVERSE),
        },
        "the lens is in `camera`; `rotation` need not be one; `picture` is not differentiated",
    )
}
OPERATIONS = tuple(DECLARED)
LENS = {"fx": 19.0, "fy": 23.0, "cx": 9.5, "cy": 7.25, "width": 19, "height": 15}
COUNT = 12


def cases() -> list[Spec]:
    """Points inside the picture, and points at its edges and behind the camera."""
    flags = ("pixel_corner_sampled", "bicubic_of_opencv", "relative_pose_inverted", "slope_without_depth")
    inside = Spec("registration", "inside", "registration", "Points inside the picture", flags, {"camera": LENS},
                  _inputs("inside"))  # fmt: skip
    inputs = _inputs("edges")
    recipe = "the first three points behind the camera, right of and above the picture"
    hidden = [[-0.5, 2.5, 0.25], [0.125, 0.125, -1.75], [-4.0, 4.0, 4.0]]
    inputs["points"] = changed(inputs["points"], (slice(None), slice(0, 3)), hidden, recipe)
    edges = Spec("registration", "edges", "registration", "Points that the picture does not show", ("behind_seen",),
                 {"camera": LENS}, inputs)  # fmt: skip
    return [inside, edges]


def _inputs(name: str) -> dict[str, Made]:
    """A pose near the identity, points in view, a picture, and the gradient."""
    seeds = Seeds("registration", name)
    turn = seeds.uniform("rotation", -0.0625, 0.0625, 3, 3)
    slope = seeds.uniform("slope", -0.125, 0.125, 2, COUNT)
    z = seeds.uniform("depth", 3.5, 4.5, COUNT)
    points = np.concatenate([slope.array * z.array, z.array[None]])
    return {
        "rotation": given(np.eye(3) + turn.array, f"identity + {turn.recipe}"),
        "translation": seeds.uniform("translation", -0.25, 0.25, 3, unit="scene"),
        "points": given(points, f"z ({slope.recipe}), z = {z.recipe}", "scene unit"),
        "reference": seeds.uniform("reference", -1.0, 1.0, COUNT),
        "picture": seeds.uniform("picture", -1.0, 1.0, LENS["height"], LENS["width"]),
        "d_residual": seeds.uniform("d_residual", -1.0, 1.0, COUNT),
    }
