"""Family `projection`: screen mean, screen covariance and depth of a Gaussian (B3).

Position, rotation and semi-axes, a pose and gradients by the projected values come in, under each preset. Centres lie
off axis on all sides, behind the camera and just inside the near plane; one case has needles of hundreds of pixels.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.vectors.making import Made, Seeds, Spec, given
from endotsr.golden.vectors.views import PRESETS, lens_settings, pose, seen_at, spread_points
from endotsr.golden.vectors.wrong import Request, WrongPort, output, setting, swapped, within
from endotsr.golden.vectors.wrong_raster import deviating
from endotsr.splatting.covariance import covariance_forward
from endotsr.splatting.settings import PAPER

OPERATIONS = ("projection",)


def _shape_inputs(seeds: Seeds, count: int) -> dict[str, Made]:
    quaternion = seeds.uniform("quaternion", -1.0, 1.0, 4, count).array
    rotation = covariance_forward(quaternion, np.zeros((3, count)))[0].rotation
    return {
        "rotation": given(rotation, f"R of uniform(-1, 1) quaternions, seed {seeds.seed('quaternion')}"),
        "scale": seeds.uniform("scale", 0.2, 1.0, 3, count, unit="scene unit"),
        "d_mean2d": seeds.uniform("d_mean2d", -1.0, 1.0, 2, count, unit="loss per px"),
        "d_covariance2d": seeds.uniform("d_covariance2d", -1.0, 1.0, 3, count, unit="loss per px^2"),
        "d_depth": seeds.uniform("d_depth", -1.0, 1.0, count, unit="loss per scene unit"),
    }


def _preset(name: str) -> Spec:
    seeds, cast = Seeds("projection", name), pose()
    points = spread_points(seeds, 12)
    z = points[2]
    points[0, :5] = z[:5] * [1.1, -1.1, 0.1, 0.1, 1.1]
    points[1, :5] = z[:5] * [0.1, 0.1, 1.1, -1.1, 1.1]
    points[2, 5:8] = [-3.0, 0.1875, 0.21875]
    points[:2, 5:8] = 0.03125
    inputs = _shape_inputs(seeds, 12) | {"position": seen_at(points, cast)} | cast
    flags = ("pixel_corner_mean", "low_pass_missing", "near_plane_zero", "pose_inverted", "shape_rotation_ignored",
             *(("jacobian_clamp_missing",) if name != "exact" else ("jacobian_clamped",)),
             *(("clamp_term_twice",) if name == "paper" else ()))  # fmt: skip
    title = f"Preset {name}: centres off axis on all sides, behind the camera, just inside the near plane"
    return Spec("projection", name, "projection", title, flags, lens_settings(PRESETS[name]), inputs)


def _needle() -> Spec:
    seeds, cast = Seeds("projection", "needle"), pose()
    inputs = _shape_inputs(seeds, 4) | {"position": seen_at(spread_points(seeds, 4), cast)} | cast
    inputs["scale"] = given(np.array([[20.0] * 4, [1e-3] * 4, [2e-3] * 4]), "20, 1e-3, 2e-3", "scene unit")
    return Spec("projection", "needle", "projection", "Needles: long axes of hundreds of pixels",
                ("shape_rotation_ignored",), lens_settings(PAPER), inputs)  # fmt: skip


def cases() -> list[Spec]:
    """The three presets, and needles."""
    return [*(_preset(name) for name in PRESETS), _needle()]


# ---- mistakes ----


def _pose_inverted(request: Request) -> dict[str, NDArray]:
    rotation = request.inputs["rotation_matrix"]
    inputs = dict(request.inputs) | {"rotation_matrix": np.ascontiguousarray(rotation.T)}
    return request.run(inputs, request.settings)


def _clamped_jacobian(request: Request) -> dict[str, NDArray] | None:
    if request.settings["raster"]["jacobian_clamp"] > 0:
        return None
    return setting(raster__jacobian_clamp=1.3)(request)  # type: ignore[return-value]


WRONG_PORTS = [
    WrongPort("pixel_corner_mean", "Screen mean half a pixel off", "u - 1/2; right: u = fx x/z + cx",
              {"projection": output(mean2d=lambda a: np.where(a != 0, a - 0.5, a))}),
    WrongPort("low_pass_missing", "No low-pass", "covariance as it is; right: + 0.3 px^2 on the diagonal",
              within("raster", ("projection", "render", "objective"), low_pass=1e-6)),
    WrongPort("jacobian_clamp_missing", "Jacobian not clamped off axis", "none; right: 1.3 tan(fov / 2)",
              within("raster", ("projection", "render"), jacobian_clamp=0.0)),
    WrongPort("jacobian_clamped", "Jacobian clamped in preset exact", "1.3 tan(fov / 2); right: none",
              {"projection": _clamped_jacobian}),
    WrongPort("clamp_term_twice", "Factor 2 in the gradient of the clamped Jacobian", "2 / z; right: 1 / z",
              {"projection": deviating("double_clamp_term"), "render": deviating("double_clamp_term")}),
    WrongPort("near_plane_zero", "Near plane at 0", "z > 0; right: z > near",
              within("raster", ("projection", "render"), near=1e-3)),
    WrongPort("pose_inverted", "Pose taken as camera to world", "W^T; right: world to camera",
              {"projection": _pose_inverted, "render": _pose_inverted, "objective": _pose_inverted}),
    WrongPort("shape_rotation_ignored", "Axes of the Gaussian not rotated", "S; right: R S",
              {"projection": swapped(lambda i: {"rotation": np.tile(np.eye(3)[:, :, None],
                                                                    i["scale"].shape[1:]).astype(i["scale"].dtype)})}),
]  # fmt: skip
