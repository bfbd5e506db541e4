"""Numbers on the side of 0, of 1 or of an edge of the picture where no other case has one.

A program that changes a port in one place at a time found them: a slope above 1, a negative given derivative, a
covariance that leans by more than its height, a gradient that is exactly 0, a clipped log-scale beside usual ones, the
third tile of a row, a point left of the picture or just behind the camera, a box that reaches into the picture from
outside, a Gaussian too faint to count.
"""

import numpy as np

from endotsr.method.splatting.settings import PAPER
from makers.composite import tile_case
from makers.images import HEIGHT, WIDTH, tool_mask
from makers.making import Seeds, Spec, changed, given, scalar
from makers.registration import LENS as PICTURE
from makers.screens import raster_settings, screen_inputs
from makers.views import cotangents, lens_settings, pose, scene_inputs

OPERATIONS = (
    "reading", "masked_ssim", "smoothness", "pose", "registration", "covariance", "harmonics", "composite", "render",
)  # fmt: skip


def _plain() -> list[Spec]:
    """A number above 1; images of large covariance; steep depth with a negative given derivative."""
    alike, steep = Seeds("masked_ssim", "alike"), Seeds("smoothness", "steep")
    observed = alike.uniform("observed", 0.0, 8.0, 3, HEIGHT, WIDTH, unit="display")
    rendered = given(1.25 * observed.array - 0.5, "5/4 observed - 1/2", "display")
    edges = np.zeros((HEIGHT, WIDTH), bool)
    edges[:5, 3] = True
    return [
        Spec("reading", "above_1", "reading", "A number above 1", (), {"gaussian": 1, "row": 0}, {
            "harmonics": given(np.arange(24.0).reshape(4, 3, 2) / 4, "k / 4 for entry k in row-major order"),
            "mask": given(np.eye(2, 3, dtype=bool), "True at (0, 0) and (1, 1)"),
            "scalar": scalar(3.25), "empty": given(np.zeros((0, 3)), "no coefficient")}),
        Spec("masked_ssim", "alike", "masked_ssim", "Images with covariances above 1", (), {},
             {"rendered": rendered, "observed": observed, "mask": tool_mask(), "d_ssim": scalar(-1.5)}),
        Spec("smoothness", "steep", "smoothness", "Steps of many units, a negative given derivative", (),
             {"total_variation_factor": 2.0}, {
            "rendered_depth": steep.uniform("rendered_depth", 0.0, 90.0, HEIGHT, WIDTH, unit="scene unit"),
            "rendered": steep.uniform("rendered", 0.0, 9.0, 3, HEIGHT, WIDTH, unit="display"), "mask": tool_mask(),
            "edges": given(edges, "True in column 3, rows 0..4"), "d_loss": scalar(-1.25)}),
    ]  # fmt: skip


def _cameras() -> list[Spec]:
    """A steep gradient of a pose of half a radian; points that the picture does not show; clipped log-scales."""
    turn, pair, shape = Seeds("pose", "steep"), Seeds("registration", "outside"), Seeds("covariance", "clipped_beside")
    outside = [[-2.875, 0.0, 0.03125, 0.25], [0.0, -2.0, 0.0625, -0.25], [4.0, 4.0, -0.5, 4.0]]
    size = int(PICTURE["height"]), int(PICTURE["width"])
    log_scale = shape.uniform("log_scale", -1.0, 1.0, 3, 4)
    return [
        Spec("pose", "steep", "pose", "Half a radian with gradients far above 1", (), {}, {
            "rotation": turn.uniform("rotation", -1.0, 1.0, 3, 3),
            "translation": given([2.0, -3.0, 4.0], "2, -3, 4", "scene"),
            "rotation_vector": given([-0.3, 0.37, 0.21], "-0.3, 0.37, 0.21", "rad"),
            "offset": turn.uniform("offset", -1.0, 1.0, 3, unit="scene"),
            "d_corrected_rotation": turn.uniform("d_corrected_rotation", -9.0, 9.0, 3, 3),
            "d_corrected_translation": given([-30.0, -20.0, 10.0], "-30, -20, 10")}),
        Spec("registration", "outside", "registration", "Points left of, above and just behind the picture",
             ("behind_seen",), {"camera": PICTURE}, {
            "rotation": given(np.eye(3), "identity"), "translation": given(np.zeros(3), "0", "scene"),
            "points": given(outside, "left of the picture, above it, half a unit behind the camera, inside",
                            "scene unit"),
            "reference": pair.uniform("reference", -1.0, 1.0, 4),
            "picture": pair.uniform("picture", -1.0, 1.0, *size),
            "d_residual": pair.uniform("d_residual", -1.0, 1.0, 4)}),
        Spec("covariance", "clipped_beside", "covariance", "A clipped log-scale beside two of usual size", (), {}, {
            "quaternion": shape.uniform("quaternion", -1.0, 1.0, 4, 4),
            "log_scale": changed(log_scale, ([0, 1, 2], [0, 1, 2]), -45.0, "(0, 0), (1, 1), (2, 2) are -45"),
            "d_rotation": shape.uniform("d_rotation", -1.0, 1.0, 3, 3, 4),
            "d_scale": shape.uniform("d_scale", -1.0, 1.0, 3, 4)}, ("log_scale",)),
    ]  # fmt: skip


def _screens() -> list[Spec]:
    """Bands of degree 3 along a diagonal, a leaning covariance with rows of zero gradient, the third tile."""
    colour, screen = Seeds("harmonics", "diagonal"), Seeds("composite", "leaning")
    along = colour.uniform("position", -2.0, 2.0, 3, 4, unit="scene unit")
    drawn = screen_inputs(screen, 6, 4.0, 30.0)
    lean = (slice(None), 2)
    drawn["covariance2d"] = changed(drawn["covariance2d"], lean, [48.0, 10.0, 4.0], "2 is (48, 10, 4)")
    for name in ("d_colour_image", "d_depth_image", "d_opacity_image"):
        drawn[name] = changed(drawn[name], (..., slice(5, 8), slice(None)), 0.0, "0 in rows 5..7")
    title = "A disc in the third tile of a row begins there"
    return [
        Spec("harmonics", "diagonal", "harmonics", "Degree 3 along (1, 0, -1)", (), {"degree": 3}, {
            "harmonics": colour.uniform("harmonics", -0.4, 0.6, 16, 3, 4),
            "residual": colour.uniform("residual", -0.3, 0.3, 3, 4),
            "position": changed(along, (slice(None), 0), [2.0, 0.0, -2.0], "0 is (2, 0, -2)"),
            "centre": given(np.zeros(3), "0", "scene unit"),
            "d_colour": colour.uniform("d_colour", -1.0, 1.0, 3, 4)}),
        Spec("composite", "leaning", "composite", "A covariance with b > c; rows without a gradient", (),
             raster_settings(PAPER), drawn),
        tile_case("third_tile", title, ("tiles_unbounded",), [46.5625, 8.3, 24.0], [8.2, 7.4, 10.0],
                  [21.375, 4.0, 4.0]),
    ]  # fmt: skip


def _boxes() -> Spec:
    """Flat Gaussians at depth 4 whose centres are left of and above the picture, and one too faint to count."""
    seeds = Seeds("render", "one_axis")
    inputs = scene_inputs(seeds, 5, 1, pose(static=True)) | cotangents(seeds)
    inputs["residual"] = seeds.uniform("residual", -0.2, 0.2, 3, 5)
    four = (slice(None), slice(0, 4))
    inputs["position"] = changed(inputs["position"], four, _column([-2.75, 0.0, -2.75, 0.5], [0.0, -2.25, 0.0, 0.5]),
                                 "0..3 are (-11/4, 0, 4), (0, -9/4, 4), (-11/4, 0, 4.25), (1/2, 1/2, 4.5)")  # fmt: skip
    inputs["quaternion"] = changed(inputs["quaternion"], four, [[1.0], [0.0], [0.0], [0.0]], "0..3 are (1, 0, 0, 0)")
    wide, thin = -0.375, -4.0
    sides = [[wide, thin, thin, wide], [thin, wide, wide, wide], [thin] * 4]
    inputs["log_scale"] = changed(inputs["log_scale"], four, sides, "0..3 are wide (-3/8) along x, y, y, both, else -4")
    opacity = changed(inputs["opacity_logit"], slice(0, 3), 2.0, "0..2 are 2")
    inputs["opacity_logit"] = changed(opacity, 3, -6.5, "3 is -6.5: below the cutoff")
    title = "Boxes that reach into the picture along one axis alone; a Gaussian below the cutoff is not visible"
    return Spec("render", "one_axis", "render", title, ("visible_if_in_front",), lens_settings(PAPER, degree=1), inputs)


def _column(x: list[float], y: list[float]) -> list[list[float]]:
    """Positions at depths 4, 4, 4.25 and 4.5."""
    return [x, y, [4.0, 4.0, 4.25, 4.5]]


def cases() -> list[Spec]:
    """In the order of the method."""
    return [*_plain(), *_cameras(), *_screens(), _boxes()]
