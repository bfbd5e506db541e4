"""Family `render`: one view of deformed Gaussians, (B2) to (B5) together, with every gradient.

Inputs: raw parameters, a pose, a background and gradients with respect to the three images. The cases are the presets
and degrees, then scenes that reveal mistakes of ports: the near plane, needles, a zero quaternion, equal depths,
centres outside the image, no Gaussian, and the visibility of Gaussians.
"""

from collections.abc import Callable

import numpy as np

from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER, RasterSettings
from makers.composite import UNITS
from makers.making import Made, Seeds, Spec, changed, given
from makers.operations import PER_DISPLAY, PER_LENGTH, Declared, Judged
from makers.views import LENS, cotangents, lens_settings, logit_of, pose, scene_inputs

DECLARED = {
    "render": Declared(
        {
            **{name: Judged(3, unit, oracle="render.render_forward") for name, unit in UNITS.items()},
            "visible": Judged(3, scale="exact"),
            "d_position": Judged(3, PER_LENGTH, "last"),
            "d_quaternion": Judged(3, "loss", "last"),
            "d_log_scale": Judged(3, "loss", "last"),
            "d_opacity_logit": Judged(3, "loss", "last"),
            "d_harmonics": Judged(3, "loss", "last"),
            "d_residual": Judged(3, "loss", "last"),
            "d_mean2d": Judged(3, "loss per px", "last"),
            "d_background": Judged(3, PER_DISPLAY),
            "d_rotation_matrix": Judged(3, "loss"),
            "d_translation": Judged(3, PER_LENGTH),
        },
        "raw parameters, already at their time; `conic_epsilon` uses the det of (B3); `d_mean2d` = gradient with"
        " respect to the screen mean, for density control; `visible` = counted by its statistic (B11), asked for where"
        " no box ends within 0.1 px of a pixel centre",
        equations="(B2) to (B5)",
    )
}
OPERATIONS = tuple(DECLARED)


def _view(case: str, count: int, degree: int, static: bool) -> dict[str, Made]:
    seeds = Seeds("render", case)
    inputs = scene_inputs(seeds, count, degree, pose(static)) | cotangents(seeds)
    return inputs | {"residual": seeds.uniform("residual", -0.2, 0.2, 3, count)}


def _presets() -> list[Spec]:
    shared = ("pixel_corner_camera", "low_pass_missing", "quaternion_xyzw")
    moving = (*shared, "pose_inverted")
    rows: list[tuple[str, RasterSettings, int, bool, str, tuple[str, ...]]] = [
        ("exact", EXACT, 3, False, "The definition: every Gaussian at every pixel", (*moving, "cutoff_added")),
        ("paper", PAPER, 3, False, "The shared semantics, moving camera",
         (*moving, "cutoff_missing", "depth_gradient_dropped", "screen_gradient_in_ndc",
          "optical_centre_is_translation",
          "view_direction_not_to_position", "view_direction_not_to_pose")),
        ("legacy", LEGACY, 3, False, "The released code's support and gradients", (*moving, "deviations_off")),
        *((f"paper_degree_{d}", PAPER, d, True, f"Degree {d}, static camera at the origin", shared) for d in range(3)),
    ]  # fmt: skip
    return [
        Spec("render", case, "render", title, flags, lens_settings(preset, degree=degree),
             _view(case, 12, degree, static), without=("visible",))
        for case, preset, degree, static, title, flags in rows
    ]  # fmt: skip


def _hard(case: str, title: str, flags: tuple[str, ...], change: Callable[[dict[str, Made]], None], **more) -> Spec:
    """Eight Gaussians of degree 1 in front of a static camera, with a change."""
    inputs = _view(case, 8, 1, True)
    change(inputs)
    return Spec("render", case, "render", title, flags, lens_settings(PAPER, degree=1), inputs,
                without=("visible",), **more)  # fmt: skip


def _near(inputs: dict[str, Made]) -> None:
    four = slice(0, 4)
    z = [0.1984375, 0.2015625, -2.0, 0.0]
    position = changed(inputs["position"], (2, four), z, "z of 0..3 is 0.198, 0.202, -2, 0")
    inputs["position"] = changed(position, (slice(0, 2), four), 0.015625, "x, y of 0..3 are 1/64")
    inputs["log_scale"] = changed(inputs["log_scale"], (slice(None), four), [[-4.0], [-4.5], [-5.0]],
                                  "0..3 are -4, -4.5, -5")  # fmt: skip


def _thin(inputs: dict[str, Made]) -> None:
    inputs["log_scale"] = changed(inputs["log_scale"], (slice(None), slice(0, 3)), [[1.5], [-7.0], [-6.0]],
                                  "0..2 are 1.5, -7, -6")  # fmt: skip


def _no_turn(inputs: dict[str, Made]) -> None:
    inputs["quaternion"] = changed(inputs["quaternion"], (slice(None), 4), 0.0, "quaternion 4 is 0")


def _ties(inputs: dict[str, Made]) -> None:
    inputs["position"] = changed(inputs["position"], 2, 4.0, "z is 4 for all")


def _far(inputs: dict[str, Made]) -> None:
    inputs["position"] = changed(inputs["position"], 0, inputs["position"].array[2] * 1.5, "x = 1.5 z")
    inputs["log_scale"] = changed(inputs["log_scale"], ..., inputs["log_scale"].array + 1.25, "log-scale plus 1.25")


def _empty(inputs: dict[str, Made]) -> None:
    for name in ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual"):
        inputs[name] = given(inputs[name].array[..., :0], "no Gaussian", inputs[name].unit)


def _long_needles() -> Spec:
    """A needle of 3000 pixels across the image, and two needles with centres 1000 pixels outside."""
    angle, along = np.array([0.7, 2.2, -0.4]), np.array([0.0, 260.0, -300.0])
    axis = np.stack([np.cos(angle), np.sin(angle), 0 * angle])
    middle = np.array([[0.1, -0.3, 0.2], [-0.2, 0.1, 0.4], [4.0, 4.5, 5.0]])
    turn = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)])
    inputs = _view("long_needle", 3, 0, True) | {
        "position": given(middle + along * axis, "(0.1, -0.2, 4), (-0.3, 0.1, 4.5), (0.2, 0.4, 5) plus (0, 260, -300) "
                          "(cos a, sin a, 0), a = 0.7, 2.2, -0.4", "scene unit"),
        "quaternion": given(turn, "(cos a/2, 0, 0, sin a/2)"),
        "log_scale": given([[6.5] * 3, [-7.0] * 3, [-7.0] * 3], "6.5, -7, -7"),
        "opacity_logit": given([2.0, 1.0, 0.5], "2, 1, 1/2"),
    }  # fmt: skip
    flags = ("determinant_cancels", "distance_cancels")
    still = ("position", "quaternion", "log_scale", "rotation_matrix", "translation")
    return Spec("render", "long_needle", "render", "Needles of 3000 px keep their digits in float32", flags,
                lens_settings(PAPER, degree=0), inputs, still,
                without=("visible", "d_position", "d_mean2d", "d_rotation_matrix", "d_translation"))  # fmt: skip


def _out_of_view() -> Spec:
    """In view; outside the image, near and far; behind; too faint; between the pixel centres."""
    u = np.array([8.25, -2.0, -30.0, 10.0, 23.5, 9.0, 7.0, 12.0])
    v = np.array([9.5, 6.0, 8.0, 40.0, 4.0, 9.0, 8.0, 7.0])
    z = np.array([4.0, 5.0, 3.0, 6.0, 3.5, -2.0, 4.5, 5.5])
    place = [(u - LENS["cx"]) / LENS["fx"] * z, (v - LENS["cy"]) / LENS["fy"] * z, z]
    text = "; ".join(f"{name} = {', '.join(map(str, values.tolist()))}" for name, values in zip("uvz", (u, v, z)))
    inputs = _view("visits", 8, 0, True) | {
        "position": given(np.stack(place), f"seen at {text}", "scene unit"),
        "log_scale": given([[-1.0] * 6 + [-7.0, -1.0]] * 3, "-1, that of 6 is -7"),
        "opacity_logit": logit_of([0.8, 0.7, 0.9, 0.9, 0.8, 0.9, 0.0045, 0.003]),
    }
    return Spec("render", "visits", "render", "Which Gaussians the statistic of density control counts as visible",
                ("visible_if_in_front",), lens_settings(PAPER, degree=0), inputs)  # fmt: skip


def cases() -> list[Spec]:
    """Presets and degrees, then hard scenes."""
    return [
        *_presets(),
        _hard("near_plane", "z just below and above the near plane, behind, and 0", ("near_plane_zero",), _near),
        _hard("needle", "Needles of forty pixels and a thousandth of one", ("low_pass_missing",), _thin),
        _hard("zero_quaternion", "A zero quaternion renders as the identity", ("zero_quaternion",), _no_turn,
              still=("quaternion",), own=("colour_image", "depth_image", "opacity_image")),
        _hard("equal_depths", "All at one depth: index order", ("ties_reversed",), _ties,
              still=("position", "rotation_matrix", "translation")),
        _hard("off_axis", "Every centre beyond the limit of the Jacobian",
              ("jacobian_clamp_missing", "clamp_term_twice"), _far),
        _hard("no_gaussian", "No Gaussian: the background", ("background_missing",), _empty),
        _long_needles(),
        _out_of_view(),
    ]  # fmt: skip
