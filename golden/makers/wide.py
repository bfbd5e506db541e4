"""Cases with numbers of both signs and beyond 1, one for each operation, so that a clamp in the wrong place shows.

A table of the least and the largest number of every array of the cases found them: a coefficient, a gradient given from
outside, a loss or a weight that never exceeded 1 passes through a clamp at 1, and one that never fell below 0 through a
clamp at 0. `makers.switches` has the settings of training in combinations that no other case has.
"""

import numpy as np

from endotsr.method.splatting.settings import PAPER
from makers.clock import omegas, stamps, train_index
from makers.images import tissue, tool_mask
from makers.making import Made, Seeds, Spec, changed, given, scalar
from makers.registration import LENS as PICTURE
from makers.screens import HEIGHT, WIDTH, raster_settings, screen_inputs
from makers.views import LENS, lens_settings, scene_inputs, seen_at, shape_inputs, spread_points

OPERATIONS = (
    "dictionary", "atoms", "appearance", "motion", "matern", "laplacian", "calibration", "deformation", "adam",
    "masked_l1", "masked_ssim", "normalised_depth", "smoothness", "exposure", "pose", "registration", "covariance",
    "projection", "harmonics", "composite", "render",
)  # fmt: skip
CASE, TITLE = "wide", "Numbers of both signs and beyond 1: nothing is clamped"


def _case(operation: str, inputs: dict[str, Made], case: str = CASE, **settings: object) -> Spec:
    return Spec(operation, case, operation, TITLE, (), settings, inputs)


def _time() -> list[Spec]:
    """(1) to (4), (B1): a time before 0, where a remainder of some languages is negative."""
    at, base, colour, moved, rough, bent = (
        Seeds(name, CASE) for name in ("dictionary", "atoms", "appearance", "motion", "matern", "deformation")
    )
    shape = (10, 2, 3)
    return [
        Spec("dictionary", "before_the_start", "dictionary",
             "A time before 0 is not clamped; its quarter turns are negative", ("time_clamped",), {},
             {"t": scalar(-0.40625), "omega": omegas(5), "d_phi": at.uniform("d_phi", -3.0, 3.0, 10)}),
        _case("atoms", {"times": stamps(24), "train_index": train_index(24), "omega": omegas(3, 5.0),
                        "phi": base.uniform("phi", -3.0, 3.0, 6),
                        "d_phi_bar": base.uniform("d_phi_bar", -3.0, 3.0, 6)}),
        _case("appearance", {
            "appearance_coefficients": colour.uniform("colour_coefficients", -1.5, 1.5, 3, 4, 5),
            "phi_bar": colour.uniform("phi_bar", -2.0, 2.0, 4),
            "d_residual": colour.uniform("d_residual", -30.0, 30.0, 3, 5)}, beta=1.5),
        _case("motion", {
            "motion_coefficients": moved.uniform("motion_coefficients", -4.0, 4.0, 3, 4, 5, unit="scene unit"),
            "phi": moved.uniform("phi", -3.0, 3.0, 4),
            "d_translation": moved.uniform("d_translation", -3.0, 3.0, 3, 5)}),
        _case("matern", {
            "omega": given([0.25, 0.75, 2.5], "1/4, 3/4, 5/2", "cycles per sequence"),
            "motion_coefficients": rough.uniform("motion_coefficients", -4.0, 4.0, 3, 6, 5, unit="scene unit"),
            "d_penalty": scalar(-40.0)}, correlation_length=0.375),
        *(_case("deformation", {
            "fdm_weight": bent.uniform("fdm_weight", -4.0, 4.0, *shape, unit="raw parameter"),
            "fdm_centre": bent.uniform("fdm_centre", -1.5, 0.75, *shape),
            "fdm_width": bent.uniform("fdm_width", -2.0, 2.0, *shape), "t": scalar(-0.28125),
            "d_offsets": bent.uniform("d_offsets", -3.0, 3.0, 10, 3)}, basis="quartic"),),
    ]  # fmt: skip


def _weight() -> Spec:
    """RMS above 1 of both gradients, and a weight of about 7; the second view has a Laplacian gradient of 0."""
    seeds = Seeds("calibration", CASE)
    steep = np.array([3.0, 0.0, 1.5, 6.0])[:, None, None, None]
    laplacian = seeds.uniform("d_laplacian", -1.0, 1.0, 4, 3, 2, 3, unit="loss per display unit")
    inputs = {
        "d_photometric": seeds.uniform("d_photometric", -9.0, 9.0, 4, 3, 2, 3, unit="loss per display unit"),
        "d_laplacian": changed(laplacian, ..., laplacian.array * steep, "view v times (3, 0, 3/2, 6)[v]"),
    }
    title = "A weight above 1: it is not clamped"
    return Spec("calibration", "heavy", "calibration", title, ("weight_at_most_one",), {"gradient_ratio": 2.5}, inputs)


def _losses() -> list[Spec]:
    """(5), (B6) to (B9): losses above 1, a similarity below 0, negative and large given gradients."""
    one, two, three, bands, rough = (
        Seeds(name, CASE) for name in ("masked_l1", "masked_ssim", "normalised_depth", "laplacian", "smoothness")
    )
    height, width = tool_mask().array.shape
    observed = {s.name: s.uniform("observed", 0.0, 1.0, 3, height, width, unit="display") for s in (one, two)}
    against = 1.25 - 1.5 * observed[two.name].array
    edges = np.zeros((height, width), bool)
    edges[4:, 6] = True
    return [
        _case("masked_l1", {"rendered": one.uniform("rendered", -6.0, 6.0, 3, height, width, unit="display"),
                            "observed": observed[one.name], "mask": tool_mask(), "d_loss": scalar(-900.0)}),
        Spec("masked_ssim", "opposed", "masked_ssim", "Opposed images have a similarity below 0", ("ssim_at_least_0",),
             {}, {"rendered": given(against, "5/4 - 3/2 observed", "display"), "observed": observed[two.name],
                  "mask": tool_mask(), "d_ssim": scalar(-900.0)}),
        _case("normalised_depth", {
            "rendered_depth": three.uniform("rendered_depth", 0.0, 3.0, height, width, unit="scene unit"),
            "prior_depth": three.uniform("prior_depth", -0.25, 2.0, height, width, unit="scene unit"),
            "mask": tool_mask(), "d_loss": scalar(-900.0)}),
        _case("smoothness", {
            "rendered_depth": rough.uniform("rendered_depth", 0.0, 20.0, height, width, unit="scene unit"),
            "rendered": rough.uniform("rendered", -3.0, 3.0, 3, height, width, unit="display"), "mask": tool_mask(),
            "edges": given(edges, "True in column 6 from row 4 on"), "d_loss": scalar(90.0)},
            total_variation_factor=30.0),
        _case("laplacian", {"rendered": bands.uniform("rendered", -9.0, 9.0, 3, 12, 13, unit="display"),
                            "observed": bands.uniform("observed", 0.0, 1.0, 3, 12, 13, unit="display"),
                            "mask": tissue(12, 13, 1, 1), "d_loss": scalar(-900.0)}, upsampling="co_sited", levels=3),
    ]  # fmt: skip


def _cameras() -> list[Spec]:
    """(B13), (B16), (B19), (B2), (B3): a camera turned by 2 rad, a rotation vector beyond half a turn."""
    light, pair, shape, lens = (Seeds(name, CASE) for name in ("exposure", "registration", "covariance", "projection"))
    turn = Seeds("pose", "turned")
    cast, turned = _turned(), shape_inputs(lens, 6)
    for name in ("d_mean2d", "d_covariance2d", "d_depth"):
        turned[name] = changed(turned[name], ..., turned[name].array * 30, "times 30")
    picture = (int(PICTURE["height"]), int(PICTURE["width"]))
    slope, z = pair.uniform("slope", -0.25, 0.25, 2, 8), pair.uniform("depth", 0.5, 9.0, 8)
    return [
        _case("exposure", {"colour": light.uniform("colour", -3.0, 3.0, 3, 4, 5, unit="display"),
                           "log_gain": light.uniform("log_gain", -2.0, 2.0, 3),
                           "bias": light.uniform("bias", -3.0, 3.0, 3, unit="display"),
                           "d_exposed": light.uniform("d_exposed", -9.0, 9.0, 3, 4, 5)}),
        _case("pose", {"rotation": turn.uniform("rotation", -3.0, 3.0, 3, 3),
                       "translation": turn.uniform("translation", -9.0, 9.0, 3, unit="scene"),
                       "rotation_vector": given([-2.75, 1.5, -2.0], "-11/4, 3/2, -2", "rad"),
                       "offset": turn.uniform("offset", -9.0, 9.0, 3, unit="scene"),
                       "d_corrected_rotation": turn.uniform("d_corrected_rotation", -9.0, 9.0, 3, 3),
                       "d_corrected_translation": given([7.0, -5.0, 3.0], "7, -5, 3")}, "turned"),
        _case("registration", {
            "rotation": given(np.eye(3) + pair.uniform("rotation", -0.125, 0.125, 3, 3).array,
                              f"identity + uniform(-0.125, 0.125) seed {pair.seed('rotation')}"),
            "translation": given([1.5, -1.25, 4.0], "3/2, -5/4, 4", "scene"),
            "points": given(np.concatenate([slope.array * z.array, z.array[None]]),
                            f"z ({slope.recipe}), z = {z.recipe}", "scene unit"),
            "reference": pair.uniform("reference", -90.0, 90.0, 8), "picture": pair.uniform("picture", -90.0, 90.0,
                                                                                            *picture),
            "d_residual": pair.uniform("d_residual", -3.0, 3.0, 8)}, camera=PICTURE),
        _case("covariance", {"quaternion": changed(shape.uniform("quaternion", -30.0, 30.0, 4, 5), (slice(None), 1),
                                                   [0.0, -2.0, -3.0, -1.0], "1 is (0, -2, -3, -1)"),
                             "log_scale": shape.uniform("log_scale", -3.0, 3.0, 3, 5),
                             "d_rotation": shape.uniform("d_rotation", -9.0, 9.0, 3, 3, 5),
                             "d_scale": shape.uniform("d_scale", -9.0, 9.0, 3, 5)}),
        _case("projection", turned | {"position": seen_at(spread_points(lens, 6), cast)} | cast,
              **lens_settings(PAPER)),
    ]  # fmt: skip


def _turned() -> dict[str, Made]:
    """A camera turned by 2.5 rad about an axis with entries of both signs, and moved by several units."""
    axis, c, s = np.array([0.48, -0.8, 0.36]), np.cos(2.5), np.sin(2.5)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return {
        "rotation_matrix": given(c * np.eye(3) + s * cross + (1 - c) * np.outer(axis, axis),
                                 "rotation by 2.5 about (0.48, -0.8, 0.36)"),
        "translation": given([-3.5, 2.25, -1.75], "-7/2, 9/4, -7/4", "scene unit"),
    }  # fmt: skip


def _images() -> list[Spec]:
    """(B4), (B5) and a view: bright colours and background, given gradients beyond 1, a turned camera."""
    colour, screen, view = Seeds("harmonics", CASE), Seeds("composite", CASE), Seeds("render", CASE)
    drawn = screen_inputs(screen, 6, 4.0, 90.0)
    outside = drawn["mean2d"].array * 1.5 - np.array([[WIDTH / 4], [HEIGHT / 4]])
    drawn |= {
        "mean2d": changed(drawn["mean2d"], ..., outside, "times 3/2 minus a quarter of the image"),
        "colour": screen.uniform("colour", 0.0, 9.0, 3, 6, unit="display"),
        "background": given([4.0, 0.25, 2.0], "4, 1/4, 2", "display"),
        "depth": changed(drawn["depth"], ..., drawn["depth"].array / 8, "divided by 8"),
    }
    seen = scene_inputs(view, 6, 2, _turned()) | {"residual": view.uniform("residual", -3.0, 3.0, 3, 6)}
    seen["background"] = given([4.0, 0.25, 2.0], "4, 1/4, 2", "display")
    size = int(LENS["height"]), int(LENS["width"])
    for name, (height, width), inputs, seeds in (("", (HEIGHT, WIDTH), drawn, screen), ("", size, seen, view)):
        for image, channels in (("colour", (3,)), ("depth", ()), ("opacity", ())):
            name = f"d_{image}_image"
            inputs[name] = seeds.uniform(name, -9.0, 9.0, *channels, height, width)
    return [
        _case("harmonics", {"harmonics": colour.uniform("harmonics", -2.0, 3.0, 16, 3, 5),
                            "residual": colour.uniform("residual", -9.0, 9.0, 3, 5),
                            "position": colour.uniform("position", -9.0, 9.0, 3, 5, unit="scene unit"),
                            "centre": colour.uniform("centre", -9.0, 9.0, 3, unit="scene unit"),
                            "d_colour": colour.uniform("d_colour", -30.0, 30.0, 3, 5)}, degree=3),
        _case("composite", drawn, **raster_settings(PAPER)),
        Spec("render", "turned", "render", "A camera turned by 2.5 rad, a bright background", (),
             lens_settings(PAPER, degree=2), seen, without=("visible",)),
    ]  # fmt: skip


def _steps() -> Spec:
    seeds = Seeds("adam", CASE)
    settings = {"rate": 2.5, "beta1": 0.5, "beta2": 0.75, "epsilon": 1e-15}
    inputs = {"parameter": seeds.uniform("parameter", -9.0, 9.0, 2, 3),
              "gradients": seeds.uniform("gradients", -30.0, 30.0, 3, 2, 3)}  # fmt: skip
    return Spec("adam", CASE, "adam", TITLE, (), settings, inputs)


def cases() -> list[Spec]:
    """In the order of the method."""
    return [*_time(), _weight(), _steps(), *_losses(), *_cameras(), *_images()]
