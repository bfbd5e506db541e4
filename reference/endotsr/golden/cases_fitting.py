"""Golden cases of schedules, density control and initialisation."""

from typing import Any

import msgspec
import numpy as np

from endotsr.config import (
    Config,
    DensityConfig,
    InitialisationConfig,
    LossConfig,
    ModelConfig,
    OptimiserConfig,
    TrainingConfig,
)
from endotsr.golden.cases import Seeds, Spec
from endotsr.golden.cases_splatting import pose
from endotsr.golden.generator import Made, changed, given, permutation
from endotsr.golden.operation import written

MILESTONES = (1, 499, 500, 501, 600, 999, 1000, 1001, 1499, 1500, 1750, 2499, 2500, 2999, 3000, 3001, 3500, 3900, 3999,
              4000, 5999, 6000)  # fmt: skip


def _schedules() -> list[Spec]:
    short = Config(
        model=ModelConfig(harmonics_degree=2),
        loss=LossConfig(lambda_lap=0.5, laplacian_from=0, laplacian_full=9, smoothness_from=5),
        optimiser=OptimiserConfig(deformation_position_factor=0.5, restart_residual_schedule=False, final_factor=0.1),
        density=DensityConfig(start=6, interval=3, until=15),
        training=TrainingConfig(iterations=20, residual_activation=8, harmonics_interval=7),
    )
    flags = ("residuals_activated_late", "rates_not_decaying", "laplacian_weight_not_ramped", "residual_rates_not_restarted",
             "degree_from_one", "densify_from_start")  # fmt: skip
    rows = [
        ("paper", Config(), MILESTONES, "Milestones of preset paper, with the iterations before and after", flags),
        ("shared_decay", short, tuple(range(1, 21)), "A short run: no restart of the residual rates, a slower position",
         ("residual_rates_restarted", "position_weights_same_rate")),
    ]  # fmt: skip
    return [
        Spec("schedule", case, "schedule", title, flags, {"config": written(config)},
             {"iteration": given(np.array(steps), ", ".join(map(str, steps)), "iteration")})
        for case, config, steps, title, flags in rows
    ]  # fmt: skip


VIEWS, COUNT = 3, 12


def _screen_gradients(seeds: Seeds) -> dict[str, Made]:
    """Gaussian n is steep where its sum with the order of a seed says so; 0 never visible, 1 exactly on 1/4."""
    d_mean = seeds.uniform("d_mean2d", -1.0, 1.0, VIEWS, 2, COUNT, unit="loss per px")
    steep = np.where(permutation(seeds.seed("steep"), COUNT) % 3 > 0, 2.0**-3, 2.0**-8)
    d_mean = changed(d_mean, ..., d_mean.array * steep, "times 2^-3, or 2^-8 where rank % 3 = 0 of the words of " +
                     seeds.seed("steep"))  # fmt: skip
    visible = (np.add.outer(np.arange(VIEWS), np.arange(COUNT)) % 4) != 1
    visible[:, 0], visible[:, 1] = False, [True, False, True]
    on = np.zeros((VIEWS, 2))
    on[:, 0] = [2.0**-5, 1.0, -(2.0**-5)]
    d_mean = changed(d_mean, (slice(None), slice(None), 1), on, "[:, :, 1] is (1/32, 0), (1, 0), (-1/32, 0)")
    recipe = "(v + n) % 4 != 1; Gaussian 0 never, Gaussian 1 in views 0 and 2"
    return {"d_mean2d": d_mean, "visible": given(visible, recipe)}


def _density_inputs(seeds: Seeds, moving: bool) -> dict[str, Made]:
    """An image of 16 x 8 pixels; a Gaussian of log-scale 0 is larger than a hundredth of the extent."""
    large = np.where(permutation(seeds.seed("large"), COUNT) % 2 > 0, 0.0, -4.0)
    scale = seeds.uniform("log_scale", -0.5, 0.5, 3, COUNT)
    logit = seeds.uniform("opacity_logit", -1.0, 2.0, COUNT)
    shift = np.stack([np.array([0.5 * k, -0.25 * k, 0.125]) for k in range(VIEWS)]) * moving
    turned = pose()["rotation_matrix"]
    return {
        "position": seeds.uniform("position", -2.0, 2.0, 3, COUNT, unit="scene unit"),
        "quaternion": changed(seeds.uniform("quaternion", -1.0, 1.0, 4, COUNT), (slice(None), 5), 0.0,
                              "quaternion 5 is 0"),
        "log_scale": changed(scale, ..., scale.array + large, "minus 4 where rank % 2 = 0 of the words of " +
                             seeds.seed("large")),
        "opacity_logit": changed(logit, slice(2, None, 5), -6.0, "[2::5] is -6: pruned"),
        **_screen_gradients(seeds),
        "split_noise": seeds.uniform("split_noise", -1.5, 1.5, 2, 3, COUNT),
        "rotation_matrices": given(np.stack([turned.array] * VIEWS), f"{turned.recipe} for all"),
        "translations": given(shift, "(k / 2, -k / 4, 1 / 8)" if moving else "0", "scene unit"),
    }  # fmt: skip


def _density() -> list[Spec]:
    def spec(case: str, title: str, flags: tuple[str, ...], moving=False, change=None, **config: Any) -> Spec:
        inputs = _density_inputs(Seeds("density", case), moving)
        if change:
            change(inputs)
        density = msgspec.to_builtins(DensityConfig(gradient_threshold=0.25, extent=30.0, **config))
        settings = {"width": 16, "height": 8, "density": density | ({"extent": "cameras"} if moving else {})}
        return Spec("density", case, "density", title, flags, settings, inputs, ("d_mean2d",))

    def tie(inputs: dict[str, Made]) -> None:
        d = inputs["d_mean2d"]
        d = changed(d, ..., d.array[:, :, :1] * 0 + 2.0**-3, "1/8 everywhere: all equally steep")
        inputs["d_mean2d"] = changed(d, (slice(None), slice(None), [8, 10]), 0.25, "Gaussians 8, 10: 1/4, the steepest")

    def faint(inputs: dict[str, Made]) -> None:
        inputs["opacity_logit"] = changed(inputs["opacity_logit"], ..., -7.0, "all -7")

    flags = ("densify_threshold_in_pixels", "density_over_all_views", "density_sum_of_views", "clone_and_split_swapped",
             "faint_ones_densified", "split_parent_kept", "children_not_smaller", "children_interleaved",
             "children_inherit_moments")  # fmt: skip
    return [
        spec("clone_split_prune", "Who is pruned, cloned and split, and in which order the new ones stand", flags),
        spec("maximum", "No room for all: the steepest, equals by index", ("first_candidates_win",), change=tie,
             maximum=14),
        spec("extent_of_cameras", "The extent that divides clones from splits, from moving cameras",
             ("extent_without_margin",), moving=True, dense_fraction=0.5),
        spec("all_pruned", "Nothing is left", ("faint_ones_densified",), change=faint),
    ]  # fmt: skip


LENS = {"fx": 7.0, "fy": 9.0, "cx": 2.75, "cy": 2.25, "width": 6, "height": 5}


def _frames(seeds: Seeds, count: int, train: list[int]) -> dict[str, Made]:
    """Every depth is its frame's own step beside a common map, so that each moves by more or less than 5."""
    height, width = int(LENS["height"]), int(LENS["width"])
    shape = (count, height, width)
    grey = seeds.uniform("images", 0.0, 256.0, count, 3, height, width).array
    common = seeds.uniform("depth", 40.0, 50.0, height, width).array
    step = seeds.uniform("step", -7.0, 7.0, *shape).array
    step = np.where(np.abs(np.abs(step) - 5.0) < 0.01, 0.0, step)
    mask = seeds.uniform("mask", 0.0, 1.0, *shape).array < 0.8
    depth = given(np.where(np.arange(count)[:, None, None] > 0, common + np.round(step * 8) / 8, common),
                  f"uniform(40, 50) seed {seeds.seed('depth')} plus, after frame 0, eighths of uniform(-7, 7) seed "
                  f"{seeds.seed('step')}", "scene unit")  # fmt: skip
    hole = seeds.uniform("hole", 0.0, 1.0, *shape).array < 0.1
    turned = pose()["rotation_matrix"]
    return {
        "images": given(np.floor(grey).astype(np.int64), f"floor of uniform(0, 256) seed {seeds.seed('images')}",
                        "display / 255"),
        "masks": given(mask, f"uniform(0, 1) seed {seeds.seed('mask')} < 0.8"),
        "prior_depths": changed(depth, hole, 0.0, f"0 where uniform(0, 1) seed {seeds.seed('hole')} < 0.1"),
        "train_index": given(np.array(train), ", ".join(map(str, train)), "frame"),
        "rotation_matrices": given(np.stack([turned.array] * count), turned.recipe),
        "translations": given(np.stack([np.array([0.25, -0.125, 0.5]) * k for k in range(count)]),
                              "(1/4, -1/8, 1/2) k", "scene unit"),
    }  # fmt: skip


def _initialisation() -> list[Spec]:
    model = written(ModelConfig(bases=3, harmonics_degree=1, initial_width=0.125))

    def spec(case: str, title: str, flags: tuple[str, ...], inputs: dict[str, Made]) -> Spec:
        drawn = InitialisationConfig(first_frame_points=1000, other_frame_points=10_000, motion_threshold=5.0)
        settings = {"camera": LENS, "initialisation": msgspec.to_builtins(drawn), "model": model}
        return Spec("initialisation", case, "initialisation", title, flags, settings, inputs)

    one = _frames(Seeds("initialisation", "one_point"), 1, [0])
    alone = np.zeros(one["masks"].array.shape, bool)
    alone[0, 2, 3] = True
    one["masks"] = given(alone, "True at (2, 3) only")
    one["prior_depths"] = changed(one["prior_depths"], (0, 2, 3), 44.0, "(2, 3) is 44")
    long = _frames(Seeds("initialisation", "long_clip"), 152, [*range(1, 8), 150, 151])
    kept = long["masks"].array & (np.arange(30).reshape(5, 6) % 7 == 0)
    long["masks"] = given(kept, f"{long['masks'].recipe} and (6 y + x) % 7 = 0")
    flags = ("backprojected_at_corner", "initialised_from_test_frames", "moved_pixels_ignored", "holes_initialised",
             "points_left_in_camera", "mean_distance_for_scale", "neighbours_count_itself",
             "initial_colour_without_y00")  # fmt: skip
    frames = _frames(Seeds("initialisation", "frames"), 6, [2, 3, 5])
    return [
        spec("frames", "Depth maps of three training frames of six, lifted with their own cameras", flags, frames),
        spec("long_clip", "Of 152 frames every second one is visited", ("long_clip_every_frame",), long),
        spec("one_point", "A single point: the floor of the scale", ("single_point_without_floor",), one),
    ]  # fmt: skip


def cases() -> list[Spec]:
    """All of them."""
    return [*_schedules(), *_density(), *_initialisation()]
