"""Family `projection`: screen mean, screen covariance and depth of a Gaussian (B3).

Inputs, for each preset: position, rotation and semi-axes, a pose and gradients with respect to the projected values.
Centres are off axis on all sides, behind the camera and just inside the near plane; one case has needles of hundreds of
pixels.
"""

import numpy as np

from endotsr.method.splatting.settings import PAPER
from makers.making import Seeds, Spec, given
from makers.operations import PER_LENGTH, Declared, Judged
from makers.views import PRESETS, lens_settings, pose, seen_at, shape_inputs, spread_points

FORWARD = "projection.projection_forward"
DECLARED = {
    "projection": Declared(
        {
            "visible": Judged(1, scale="exact"),
            "mean2d": Judged(1, "px", "last", FORWARD),
            "covariance2d": Judged(1, "px^2", "last", FORWARD),
            "depth": Judged(1, "scene unit", "last", FORWARD),
            "d_position": Judged(2, PER_LENGTH, "last"),
            "d_rotation": Judged(2, "loss", "last"),
            "d_scale": Judged(2, PER_LENGTH, "last"),
            "d_rotation_matrix": Judged(2, "loss"),
            "d_translation": Judged(2, PER_LENGTH),
        },
        "from `rotation` and `scale`; `covariance2d` = a, b, c with the low-pass; entries of invisible Gaussians are 0."
        " `d_rotation_matrix`: its nine entries taken as independent",
    )
}
OPERATIONS = tuple(DECLARED)


def _preset(name: str) -> Spec:
    seeds, cast = Seeds("projection", name), pose()
    points = spread_points(seeds, 12)
    z = points[2]
    points[0, :5] = z[:5] * [1.1, -1.1, 0.1, 0.1, 1.1]
    points[1, :5] = z[:5] * [0.1, 0.1, 1.1, -1.1, 1.1]
    points[2, 5:8] = [-3.0, 0.1875, 0.21875]
    points[:2, 5:8] = 0.03125
    inputs = shape_inputs(seeds, 12) | {"position": seen_at(points, cast)} | cast
    flags = ("pixel_corner_mean", "low_pass_missing", "near_plane_zero", "pose_inverted", "shape_rotation_ignored",
             "shape_not_turned_by_camera", "jacobian_without_depth_column", "jacobian_gradient_dropped",
             *(("jacobian_clamp_missing",) if name != "exact" else ("jacobian_clamped",)),
             *(("clamp_term_twice", "clamp_gradient_passed", "jacobian_limit_from_principal_point")
               if name == "paper" else ()))  # fmt: skip
    title = f"Preset {name}: centres off axis on all sides, behind the camera, just inside the near plane"
    return Spec("projection", name, "projection", title, flags, lens_settings(PRESETS[name]), inputs)


def _needle() -> Spec:
    seeds, cast = Seeds("projection", "needle"), pose()
    inputs = shape_inputs(seeds, 4) | {"position": seen_at(spread_points(seeds, 4), cast)} | cast
    inputs["scale"] = given(np.array([[20.0] * 4, [1e-3] * 4, [2e-3] * 4]), "20, 1e-3, 2e-3", "scene unit")
    return Spec("projection", "needle", "projection", "Needles: long axes of hundreds of pixels",
                ("shape_rotation_ignored",), lens_settings(PAPER), inputs)  # fmt: skip


def cases() -> list[Spec]:
    """The three presets, and needles."""
    return [*(_preset(name) for name in PRESETS), _needle()]
