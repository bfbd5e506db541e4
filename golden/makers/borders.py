"""Cases on either side of a border, where a decision with another constant or another side gives the same elsewhere.

Points beside each edge of a picture, boxes that just reach or just miss the image, depths below 1, atoms beside the RMS
at which they are dead, one visit or one valid pixel, cameras whose median is not their mean, frames whose poses differ.
"""

import numpy as np

from endotsr.config import InitialisationConfig, ModelConfig
from endotsr.definition.covariance import Shape
from endotsr.definition.projection import Camera, projection_forward
from endotsr.method.splatting.settings import PAPER
from makers.clock import omegas, stamps, train_index
from makers.composite import tile_case
from makers.density import density_spec
from makers.images import tool_mask
from makers.initialisation import LENS as SMALL_LENS
from makers.initialisation import frames
from makers.making import Made, Seeds, Spec, changed, given, scalar
from makers.pose import pose_inputs
from makers.registration import LENS as PICTURE
from makers.settings import OF_THE_INITIALISATION, written_section
from makers.views import LENS, cotangents, lens_settings, logit_of, pose, scene_inputs

OPERATIONS = (
    "dictionary", "atoms", "appearance", "deformation", "masked_ssim", "laplacian", "pose", "registration", "harmonics",
    "composite", "render",
    "density", "initialisation",
)  # fmt: skip


def _time() -> list[Spec]:
    """(1), (B1): after the end of the clip; RMS of 0.7e-6 and 1.5e-6 on either side of the limit; |x| up to 400."""
    late, slow, far, bent = (Seeds(*name.split("/")) for name in ("dictionary/after_the_end", "atoms/threshold",
                             "appearance/overflow", "deformation/after_the_end"))  # fmt: skip
    omega = given([3.75e-7, 8.25e-7, 2.5], "3.75e-7, 8.25e-7, 5/2", "cycles per sequence")
    given_phi = late.uniform("d_phi", -3.0, 3.0, 10)
    size = np.array([-400.0, -100.0, 0.5, 200.0])
    shape = (10, 2, 3)
    return [
        Spec("dictionary", "after_the_end", "dictionary", "A time after 1: it is not clamped", ("time_clamped",), {},
             {"t": scalar(1.71875), "omega": omegas(5), "d_phi": changed(given_phi, ..., -given_phi.array, "negated")}),
        Spec("atoms", "threshold", "atoms", "Sines with an RMS just below and just above the limit of a dead atom",
             ("dead_at_1e-5",), {},
             {"times": stamps(24), "train_index": train_index(24), "omega": omega,
              "phi": given([1e-6, 2e-6, 0.5, 1.0, 1.0, -0.5], "1e-6, 2e-6, 1/2, 1, 1, -1/2"),
              "d_phi_bar": slow.uniform("d_phi_bar", -3.0, 3.0, 6)}),
        Spec("appearance", "overflow", "appearance", "Arguments of tanh up to 400: the derivative is 0, not NaN",
             (), {"beta": 0.3},
             {"appearance_coefficients": given(np.stack([size] * 3)[:, None], "(-400, -100, 1/2, 200)[n]"),
              "phi_bar": given([1.0], "1"), "d_residual": far.uniform("d_residual", 0.5, 1.0, 3, 4)}),
        Spec("deformation", "after_the_end", "deformation", "A time after 1, centres on both sides", (),
             {"basis": "gaussian"},
             {"fdm_weight": bent.uniform("fdm_weight", -4.0, 4.0, *shape, unit="raw parameter"),
              "fdm_centre": bent.uniform("fdm_centre", 0.5, 2.5, *shape),
              "fdm_width": bent.uniform("fdm_width", -2.0, 2.0, *shape), "t": scalar(1.40625),
              "d_offsets": bent.uniform("d_offsets", -3.0, 3.0, 10, 3)}),
    ]  # fmt: skip


def _losses() -> list[Spec]:
    """(B7) with means and variances above 1; (5) with one valid pixel."""
    bright, few = Seeds("masked_ssim", "bright"), Seeds("laplacian", "one_valid")
    height, width = tool_mask().array.shape
    mask = np.zeros((9, 10), bool)
    mask[2:7, 2:7] = True
    return [
        Spec("masked_ssim", "bright", "masked_ssim", "A render of -3 to 9: its mean and variance exceed 1", (), {},
             {"rendered": bright.uniform("rendered", -3.0, 9.0, 3, height, width, unit="display"),
              "observed": bright.uniform("observed", 0.0, 1.0, 3, height, width, unit="display"), "mask": tool_mask(),
              "d_ssim": scalar(900.0)}),
        Spec("laplacian", "one_valid", "laplacian", "One valid pixel at level 1, none at levels 2 and 3", (),
             {"upsampling": "co_sited", "levels": 3},
             {"rendered": few.uniform("rendered", -9.0, 9.0, 3, 9, 10, unit="display"),
              "observed": few.uniform("observed", 0.0, 1.0, 3, 9, 10, unit="display"),
              "mask": given(mask, "True in rows and columns 2..6"), "d_loss": scalar(900.0)}),
    ]  # fmt: skip


def _turn() -> Spec:
    """An angle of 0.8 rad: closed form or series, in which the radial terms are not small."""
    inputs = pose_inputs("moderate", 1.0) | {"rotation_vector": given([-0.5, 0.375, -0.5], "-1/2, 3/8, -1/2", "rad")}
    for name in ("rotation", "offset", "d_corrected_rotation", "d_corrected_translation"):
        inputs[name] = changed(inputs[name], ..., inputs[name].array * 3, "times 3")
    title = "A moderate rotation with entries of both signs"
    return Spec("pose", "moderate", "pose", title, ("radial_gradient_dropped",), {}, inputs)


def _edges() -> Spec:
    """A point a quarter of a pixel inside and outside of each of the four limits, and one at a depth of 1/2."""
    seeds, width, height = Seeds("registration", "limits"), int(PICTURE["width"]), int(PICTURE["height"])
    u = [1.25, 0.75, width - 2.25, width - 1.75, 9.0, 9.0, 9.0, 9.0, 7.5]
    v = [7.0, 7.0, 7.0, 7.0, 1.25, 0.75, height - 2.25, height - 1.75, 6.5]
    z = np.array([4.0] * 8 + [0.5])
    points = np.stack([(np.array(u) + 0.5 - PICTURE["cx"]) / PICTURE["fx"] * z,
                       (np.array(v) + 0.5 - PICTURE["cy"]) / PICTURE["fy"] * z, z])  # fmt: skip
    inputs = {
        "rotation": given(np.eye(3), "identity"),
        "translation": given(np.zeros(3), "0", "scene"),
        "points": given(points, f"at u - 1/2 = {', '.join(map(str, u))}; v - 1/2 = {', '.join(map(str, v))}; z = 4, "
                        "that of 8 is 1/2", "scene unit"),
        "reference": seeds.uniform("reference", -1.0, 1.0, 9),
        "picture": seeds.uniform("picture", -1.0, 1.0, height, width),
        "d_residual": seeds.uniform("d_residual", -1.0, 1.0, 9),
    }  # fmt: skip
    title = "Points a quarter of a pixel inside and outside of each limit of the picture"
    return Spec("registration", "limits", "registration", title, (), {"camera": PICTURE}, inputs)


def _boxes() -> Spec:
    """Discs whose box ends 0.2 px before and after the outermost pixel centre of each side, and between two centres."""
    width, height, z = LENS["width"], LENS["height"], 4.0 + 0.125 * np.arange(9)
    sides = [(0, -1, 0.0), (0, 1, width), (1, -1, 0.0), (1, 1, height)]
    opacity, scale = [0.4, 0.7], [-2.0, -1.5]
    where = np.array([[8.0] * 9, [7.0] * 9])
    for k, (axis, side, edge) in enumerate(sides):
        for j, inside in enumerate((0.7, 0.3)):
            n = 2 * k + j
            for _ in range(30):
                reach = _half_side(where[:, n], z[n], scale[j], opacity[j], axis)
                where[axis, n] = edge + side * (reach - inside)
    where[:, 8] = [8.0, 7.0]  # between four centres, too small for any
    log_scale = np.array(scale * 4 + [-7.0])
    place = np.stack([(where[0] - LENS["cx"]) / LENS["fx"] * z, (where[1] - LENS["cy"]) / LENS["fy"] * z, z])
    seeds = Seeds("render", "boxes")
    inputs = scene_inputs(seeds, 9, 0, pose(True)) | cotangents(seeds)
    inputs |= {
        "residual": seeds.uniform("residual", -0.2, 0.2, 3, 9),
        "position": given(place, "boxes that end 0.2 px before or after the outermost pixel centres", "scene unit"),
        "log_scale": given(np.stack([log_scale] * 3), "-2 for even and -3/2 for odd n, that of 8 is -7"),
        "opacity_logit": logit_of(opacity * 4 + [0.0045]),
    }
    title = "Boxes that end just before and just after the outermost pixel centres of each side"
    return Spec("render", "boxes", "render", title, ("visible_if_in_front",), lens_settings(PAPER, degree=0), inputs,
                without=("d_quaternion",))  # fmt: skip


def _half_side(centre: np.ndarray, z: float, log_scale: float, opacity: float, axis: int) -> float:
    """Half a side of the box of a disc seen at a centre, px."""
    point = [[(centre[0] - LENS["cx"]) / LENS["fx"] * z], [(centre[1] - LENS["cy"]) / LENS["fy"] * z], [z]]
    shape = Shape(np.eye(3)[:, :, None], np.full((3, 1), np.exp(log_scale)))
    seen, _ = projection_forward(np.array(point), shape, Camera(np.eye(3), np.zeros(3), **LENS), PAPER)
    return float(np.sqrt(2 * np.log(opacity / PAPER.alpha_cutoff) * seen.covariance2d[2 * axis, 0]))


def _density() -> Spec:
    """Poses 0, 1 and 9 apart, one visit of some, a gradient of 0, scales above 1, and a prune threshold of 1/2."""

    def change(inputs: dict[str, Made]) -> None:
        moved = given([[0.0, 0.0, 0.0], [1.0, -0.5, 0.25], [9.0, -4.5, 2.25]], "(1, -1/2, 1/4) times 0, 1, 9")
        seen = inputs["visible"].array.copy()
        seen[1:, 3:6] = False
        still = inputs["d_mean2d"].array.copy()
        still[:, :, 9] = 0.0
        scale, faint = inputs["log_scale"], inputs["opacity_logit"]
        inputs |= {
            "translations": moved._replace(unit="scene unit"),
            "visible": changed(inputs["visible"], ..., seen, "3, 4, 5 in view 0 only"),
            "d_mean2d": changed(inputs["d_mean2d"], ..., still, "Gaussian 9: 0"),
            "log_scale": changed(
                changed(scale, ..., scale.array + 1.5, "plus 3/2"),
                (slice(None), 8),
                [0.7, 0.0, 0.0],
                "8 is (0.7, 0, 0)",
            ),
            "opacity_logit": changed(faint, ..., faint.array + 0.75, "plus 3/4"),
        }

    title = "Cameras whose median is not their mean, one visit, a gradient of 0, opacities on both sides of 1/2"
    return density_spec("apart", title, ("extent_without_margin",), moving=True, change=change, dense_fraction=0.25,
                        prune_opacity=0.5, growth="budget", maximum=40)  # fmt: skip


def _shallow() -> Spec:
    """Depths below 1 in steps of 1/64, some 0 or negative; a difference of exactly 1/16 is no motion."""
    seeds = Seeds("initialisation", "shallow")
    inputs = frames(seeds, 4, [0, 1, 3])
    shape = inputs["prior_depths"].array.shape
    common = np.floor(seeds.uniform("common", 0.0, 32.0, *shape[1:]).array)
    step = np.floor(seeds.uniform("move", -4.0, 5.0, *shape).array) * 2
    step[0] = 0.0
    depth = given(0.25 + (common + step) / 64, f"1/4 + (a + 2 b) / 64, a = floor of uniform(0, 32) seed "
                  f"{seeds.seed('common')}, b = floor of uniform(-4, 5) seed {seeds.seed('move')}, 0 in frame 0",
                  "scene unit")  # fmt: skip
    depth = changed(depth, (slice(None), 0, slice(0, 2)), [-0.5, 0.0], "row 0 begins -1/2, 0")
    depth = changed(depth, (slice(None), 3), 1 / 32, "row 3 is 1/32")
    depth = changed(depth, (0, 3), 0.0, "row 3 of frame 0 is 0")
    turned = pose()["rotation_matrix"].array
    turns = np.stack([np.linalg.matrix_power(turned, k) for k in range(4)])
    inputs |= {"prior_depths": depth, "rotation_matrices": given(turns, "R^k, R = Rz(0.1) Ry(-0.15) Rx(0.2)")}
    drawn = InitialisationConfig(first_frame_points=1000, other_frame_points=10_000, motion_threshold=0.0625)
    model = written_section(ModelConfig(bases=2, harmonics_degree=0, initial_width=0.125))
    settings = {"camera": SMALL_LENS, "initialisation": written_section(drawn, OF_THE_INITIALISATION), "model": model}
    title = "Depths below 1; frames with different poses; a change of just the threshold"
    return Spec("initialisation", "shallow", "initialisation", title, ("points_left_in_camera",), settings, inputs,
                ("prior_depths",))  # fmt: skip


def _pair() -> Spec:
    """Two points: each has one neighbour."""
    inputs = frames(Seeds("initialisation", "two_points"), 1, [0])
    alone = np.zeros(inputs["masks"].array.shape, bool)
    alone[0, 1, 1] = alone[0, 3, 4] = True
    inputs["masks"] = given(alone, "True at (1, 1) and (3, 4) only")
    inputs["prior_depths"] = changed(inputs["prior_depths"], (0, [1, 3], [1, 4]), [44.0, 47.0], "44 and 47 there")
    drawn = InitialisationConfig(first_frame_points=1000, other_frame_points=10_000, motion_threshold=5.0)
    model = written_section(ModelConfig(bases=2, harmonics_degree=0, initial_width=0.125))
    settings = {"camera": SMALL_LENS, "initialisation": written_section(drawn, OF_THE_INITIALISATION), "model": model}
    return Spec("initialisation", "two_points", "initialisation", "Two points: the one neighbour of each", (), settings,
                inputs)  # fmt: skip


def _bands() -> Spec:
    """Directions along the axes, and coefficients of bands that the degree does not use."""
    seeds = Seeds("harmonics", "unused_bands")
    away = np.concatenate([np.eye(3), -np.eye(3)], axis=1) * [2.0, 3.0, 0.5, 4.0, 0.25, 8.0]
    inputs = {
        "harmonics": seeds.uniform("harmonics", -2.0, 3.0, 16, 3, 6),
        "residual": seeds.uniform("residual", -3.0, 3.0, 3, 6),
        "position": given(away + 0.5, "(1/2, 1/2, 1/2) plus 2 x, 3 y, z / 2, -4 x, -y / 4, -8 z", "scene unit"),
        "centre": given([0.5, 0.5, 0.5], "1/2", "scene unit"),
        "d_colour": seeds.uniform("d_colour", -30.0, 30.0, 3, 6),
    }
    title = "Degree 2 of sixteen coefficients: the others have gradient 0; directions along the axes"
    return Spec("harmonics", "unused_bands", "harmonics", title, (), {"degree": 2}, inputs)


def cases() -> list[Spec]:
    """In the order of the method."""
    wide = "A disc of 9 px whose tiles begin where its alpha is still above the cutoff"
    before = tile_case(
        "tile_before", wide, ("tiles_unbounded",), [44.6, 20.0, 30.0], [8.2, 7.4, 10.0], [81.0, 9.0, 4.0]
    )
    return [*_time(), *_losses(), _turn(), _edges(), _bands(), before, _boxes(), _density(), _shallow(), _pair()]
