"""Family `projection`: screen mean, screen covariance and depth of a Gaussian (B3).

Position, rotation and semi-axes, a pose and gradients by the projected values come in, under each preset. Centres lie
off axis on all sides, behind the camera and just inside the near plane; one case has needles of hundreds of pixels.
"""

import numpy as np

from endotsr.splatting.settings import PAPER
from makers.making import Seeds, Spec, given
from makers.views import PRESETS, lens_settings, pose, seen_at, shape_inputs, spread_points
from makers.wrong import edit, port, with_raster

OPERATIONS = ("projection",)


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


# ---- mistakes ----

FORMULAS, MODEL, PROJECT, STAGE = (
    "splatting.projection_formulas",
    "splatting.camera_model",
    "splatting.projection",
    "stages.projection",
)
BOTH, ALL = "projection render", "projection render objective"
SLOPES = [
    (
        f"min(max({name}, -lens.limit_{axis}), lens.limit_{axis})",
        f"min(max({name}, -lens.low_{axis}), lens.limit_{axis})",
    )
    for axis in "xy"
    for name in (f"slope_{axis}", f"raw_{axis}")
]
FROM_PRINCIPAL_POINT = (
    edit(
        MODEL,
        "of the clamped term of dJ/dz: 1; 2 in `legacy`\n",
        "of the clamped term of dJ/dz: 1; 2 in `legacy`\n    low_x: float\n    low_y: float\n",
    ),
    edit(
        MODEL,
        "    return Pinhole(\n",
        """
    margin_x, margin_y = (clamp - 1) * camera.width / (2 * camera.fx), (clamp - 1) * camera.height / (2 * camera.fy)
    right, left = (camera.width - camera.cx) / camera.fx + margin_x, camera.cx / camera.fx + margin_x
    lower, upper = (camera.height - camera.cy) / camera.fy + margin_y, camera.cy / camera.fy + margin_y
    return Pinhole(
""",
    ),
    edit(MODEL, "clamp * camera.width / (2 * camera.fx) if", "right if"),
    edit(MODEL, "clamp * camera.height / (2 * camera.fy) if", "lower if"),
    edit(
        MODEL,
        "real(2 if settings.deviations.double_clamp_term else 1),\n",
        "real(2 if settings.deviations.double_clamp_term else 1),\n"
        "        real(left if clamp > 0 else np.inf),\n        real(upper if clamp > 0 else np.inf),\n",
    ),
    *(edit(MODEL, old, new) for old, new in SLOPES),
    edit(
        MODEL,
        "abs(raw_x) <= lens.limit_x, abs(raw_y) <= lens.limit_y",
        "-lens.low_x <= raw_x <= lens.limit_x, -lens.low_y <= raw_y <= lens.limit_y",
    ),
)
INVERTED = (
    edit(
        "stages.requests",
        'return Camera(inputs["rotation_matrix"], inputs["translation"], **settings["camera"])',
        'turn = np.ascontiguousarray(inputs["rotation_matrix"].T)\n'
        '    return Camera(turn, -turn @ inputs["translation"], **settings["camera"])',
    ),
    edit(
        STAGE,
        '"d_rotation_matrix": grads.d_camera.d_rotation,',
        '"d_rotation_matrix": grads.d_camera.d_rotation.T - np.outer('
        "-saved[1].camera.rotation.T @ saved[1].camera.translation, grads.d_camera.d_translation),",
    ),
    edit(
        STAGE,
        '"d_translation": grads.d_camera.d_translation,',
        '"d_translation": -saved[1].camera.rotation.T @ grads.d_camera.d_translation,',
    ),
    edit(
        "stages.compositing",
        "dtype, (d_rotation, d_translation) = saved.scene.position.dtype, grads.d_camera\n",
        "dtype, (d_rotation, d_translation) = saved.scene.position.dtype, grads.d_camera\n"
        "    back = saved.camera.rotation.T\n"
        "    d_rotation = d_rotation.T - np.outer(-back @ saved.camera.translation, d_translation)\n"
        "    d_translation = -back @ d_translation\n",
    ),
)

WRONG_PORTS = [
    port(
        "pixel_corner_mean",
        "Screen mean half a pixel off",
        "u - 1/2; right: u = fx x/z + cx",
        BOTH,
        edit(
            MODEL,
            "lens.fx * slope_x + lens.cx, lens.fy * slope_y + lens.cy",
            "lens.fx * slope_x + lens.cx - one / 2, lens.fy * slope_y + lens.cy - one / 2",
        ),
    ),
    port(
        "low_pass_missing",
        "No low-pass",
        "covariance as it is; right: + 0.3 px^2 on the diagonal",
        ALL,
        with_raster("low_pass=1e-12"),
    ),
    port(
        "jacobian_clamp_missing",
        "Jacobian not clamped off axis",
        "none; right: 1.3 tan(fov / 2)",
        ALL,
        with_raster("jacobian_clamp=0.0"),
    ),
    port(
        "jacobian_clamped",
        "Jacobian clamped in preset exact",
        "1.3 tan(fov / 2); right: none",
        ALL,
        with_raster("jacobian_clamp=found.jacobian_clamp or 1.3"),
    ),
    port(
        "clamp_term_twice",
        "Factor 2 in the gradient of the clamped Jacobian",
        "2 / z; right: 1 / z",
        ALL,
        with_raster("deviations=found.deviations._replace(double_clamp_term=True)"),
    ),
    port(
        "clamp_gradient_passed",
        "Gradient passes the clamp of the Jacobian",
        "as if it were free; right: by z alone",
        BOTH,
        edit(MODEL, "abs(raw_x) <= lens.limit_x, abs(raw_y) <= lens.limit_y", "raw_x == raw_x, raw_y == raw_y"),
    ),
    port(
        "jacobian_limit_from_principal_point",
        "Clamp of the Jacobian measured from the principal point",
        "(W - cx) / fx + 0.3 tan(fov / 2) and cx / fx + 0.3 tan(fov / 2); right: 1.3 tan(fov / 2) on either side",
        BOTH,
        *FROM_PRINCIPAL_POINT,
    ),
    port("near_plane_zero", "Near plane at 0", "z > 0; right: z > near", ALL, with_raster("near=1e-9")),
    port("pose_inverted", "Pose taken as camera to world", "its inverse; right: world to camera", ALL, *INVERTED),
    port(
        "shape_rotation_ignored",
        "Axes of the Gaussian not rotated",
        "S; right: R S",
        BOTH,
        edit(
            FORMULAS, "t = product(product(jacobian, pose.rotation), rotation)", "t = product(jacobian, pose.rotation)"
        ),
        edit(FORMULAS, "t = product(jw, rotation)", "t = jw"),
        edit(FORMULAS, "d_jw, d_rotation = product_reverse(jw, rotation, d_t)", "d_jw, d_rotation = d_t, (0 * z,) * 9"),
    ),
    port(
        "shape_not_turned_by_camera",
        "Camera rotation left out of the covariance",
        "J R S; right: J W R S",
        BOTH,
        edit(FORMULAS, "t = product(product(jacobian, pose.rotation), rotation)", "t = product(jacobian, rotation)"),
        edit(FORMULAS, "jw = product(jacobian, pose.rotation)", "jw = jacobian"),
        edit(
            FORMULAS,
            "d_jacobian, d_w = product_reverse(jacobian, pose.rotation, d_jw)",
            "d_jacobian, d_w = d_jw, (0 * z,) * 9",
        ),
    ),
    port(
        "jacobian_without_depth_column",
        "Third column of the Jacobian left out",
        "J_02 = J_12 = 0; right: -f x / z^2",
        BOTH,
        edit(MODEL, "-lens.fx * slope_x * inverse_z\n", "zero\n"),
        edit(MODEL, "-lens.fy * slope_y * inverse_z\n", "zero\n"),
        edit(
            MODEL,
            "d_j00, _, d_j02, _, d_j11, d_j12 = d_jacobian",
            "d_j00, _, d_j02, _, d_j11, d_j12 = d_jacobian\n    d_j02 = d_j12 = zero",
        ),
    ),
    port(
        "jacobian_gradient_dropped",
        "Jacobian taken as constant",
        "no gradient to the centre; right: it has one",
        BOTH,
        edit(MODEL, "d_j00, _, d_j02, _, d_j11, d_j12 = d_jacobian", "d_j00 = d_j02 = d_j11 = d_j12 = zero"),
    ),
]
