"""Cases between two others: numbers so close to a limit that a frequent shortcut of ports shows in float32.

Each belongs to the family of its operation. A depth of a few hundredths shows a small number added to a divisor, an
angle just below 0.01 the first order of a rotation, a second lens a fixed principal point, a disc whose rim ends beside
the next tile a range that includes its last tile, depths a thousandth apart a rounded key of the order, a gradient that
pauses an optimiser that skips zeros, and a budget of growth with distinct gradients its order and its room.
"""

from endotsr.method.splatting.settings import PAPER
from makers.composite import tile_case
from makers.density import density_spec, spread_gradients
from makers.images import HEIGHT, WIDTH, tool_mask, two_images
from makers.making import Seeds, Spec, changed, given, permutation, scalar
from makers.pose import FLAGS as POSE_FLAGS
from makers.pose import pose_inputs
from makers.projection import OPERATIONS as PROJECTION
from makers.screens import raster_settings, screen_inputs
from makers.views import LENS, lens_settings, pose, seen_at, shape_inputs, spread_points

OPERATIONS = ("normalised_depth", "pose", "adam", "density", "masked_l1", "composite", *PROJECTION)
SECOND_LENS = {"fx": 27.0, "fy": 16.0, "cx": 6.25, "cy": 10.5, "width": 24, "height": 15}


def _depths() -> Spec:
    seeds = Seeds("normalised_depth", "near_depths")
    inputs = {
        "rendered_depth": seeds.uniform("rendered_depth", 0.002, 0.012, HEIGHT, WIDTH, unit="scene unit"),
        "prior_depth": seeds.uniform("prior_depth", 0.0025, 0.01, HEIGHT, WIDTH, unit="scene unit"),
        "mask": tool_mask(),
        "d_loss": scalar(1.5),
    }
    title = "Depths of a hundredth: nothing is added to the largest depth"
    return Spec("normalised_depth", "near_depths", "normalised_depth", title, ("depth_plus_epsilon",), {}, inputs)


def _pose() -> Spec:
    title = "A rotation of just below 0.01 rad: its first order is not enough"
    return Spec(
        "pose",
        "hundredth",
        "pose",
        title,
        (*POSE_FLAGS[:-1], "rotation_of_first_order"),
        {},
        pose_inputs("hundredth", 5.75e-3),
    )


def _adam() -> list[Spec]:
    pause, first = Seeds("adam", "pause"), Seeds("adam", "first_step")
    slopes = pause.uniform("gradients", -4.0, 4.0, 3, 3, 4)
    slopes = changed(slopes, 1, 0.0, "[1] is 0: the moments decay, and the parameter moves on")
    usual = {"beta1": 0.9, "beta2": 0.999, "epsilon": 1e-15}
    return [
        Spec("adam", "pause", "adam", "A gradient of 0 between two others is a step", ("adam_skips_zeros",),
             usual | {"rate": 0.05}, {"parameter": pause.uniform("parameter", -1.0, 1.0, 3, 4), "gradients": slopes}),
        Spec("adam", "first_step", "adam", "The first step: 1 - beta keeps its digits",
             ("adam_without_bias_correction",), usual | {"rate": 4.0},
             {"parameter": first.uniform("parameter", -1.0, 1.0, 3, 4),
              "gradients": first.uniform("gradients", -1.0, 1.0, 1, 3, 4)}),
    ]  # fmt: skip


def _density() -> list[Spec]:
    return [
        density_spec("maximum_of_distinct", "Room for three of several: the steepest, whose gradients are distinct",
                     ("first_candidates_win",), change=spread_gradients, maximum=13),
        density_spec("budget", "Growth to a budget: the steepest, without a threshold", ("first_candidates_win",),
                     change=spread_gradients, maximum=13, growth="budget", gradient_threshold=2.9),
    ]  # fmt: skip


def _bright() -> Spec:
    seeds = Seeds("masked_l1", "bright")
    images = two_images(seeds)
    bright = changed(images["rendered"], 0, images["rendered"].array[0] + 1.25, "[0] plus 1.25: red above 1")
    inputs = images | {"rendered": bright, "mask": tool_mask(), "d_loss": scalar(1.25)}
    return Spec(
        "masked_l1",
        "bright",
        "masked_l1",
        "A render above 1 is not clamped in the loss",
        ("l1_of_clamped_render",),
        {},
        inputs,
    )


def _second_camera() -> Spec:
    seeds, cast = Seeds("projection", "second_camera"), pose()
    inputs = shape_inputs(seeds, 8) | {"position": seen_at(spread_points(seeds, 8), cast)} | cast
    settings = lens_settings(PAPER) | {"camera": {**LENS, **SECOND_LENS}}
    title = "Another lens: focal lengths, principal point and size"
    return Spec("projection", "second_camera", "projection", title, ("pixel_corner_mean",), settings, inputs)


def _screens() -> list[Spec]:
    """Discs of 3 px whose radius is 10: the first ends in column 16.95 - 1, the second in row 15.9."""
    seeds = Seeds("composite", "close_depths")
    inputs = screen_inputs(seeds, 8, 4.0, 90.0)
    near = 3.0 + 1e-3 * permutation(seeds.seed("order"), 8)
    text = f"3 + k / 1000, k = stable order of the words of {seeds.seed('order')}"
    inputs["depth"] = given(near, text, "scene unit")
    halves = "A disc that ends in the second half of a tile: tiles of 8 px would cut it there"
    tiles = "A disc that reaches the next tile beyond three sigma alone is not drawn there"
    return [
        Spec("composite", "close_depths", "composite", "Overlapping Gaussians with depths a thousandth apart",
             ("order_by_index", "depths_in_steps"), raster_settings(PAPER), inputs),
        tile_case("next_tile", tiles, ("tiles_unbounded",), [7.45, 23.4, 30.0], [8.2, 7.4, 10.0], [9.0, 9.0, 4.0]),
        tile_case("half_tile", halves, (), [10.25, 37.5, 30.0], [8.2, 7.4, 10.0], [20.0, 4.0, 4.0]),
    ]  # fmt: skip


def cases() -> list[Spec]:
    """In the order of the families."""
    return [*_adam(), _bright(), _depths(), _pose(), _second_camera(), *_screens(), *_density()]
