"""Family `density`: density control (B11), the statistics of some views and one densification.

Inputs: raw parameters, screen gradients and visibility by view, the noise of splits, and camera poses. The cases test
the selection of pruned, cloned and split Gaussians, the order of the new Gaussians, the selection of candidates if
there is too little room, the extent of moving cameras, and values exactly on the thresholds.
"""

from typing import Any

import numpy as np

from endotsr.config import DensityConfig
from makers.making import Made, Seeds, Spec, changed, given, permutation
from makers.operations import Declared, Judged
from makers.settings import written_section
from makers.views import pose

DENSIFY = "density_control.densify"
DECLARED = {
    "density": Declared(
        {
            "extent": Judged(1, "scene unit", oracle=DENSIFY),
            "mean_gradient": Judged(1, "loss per NDC unit", oracle=DENSIFY),
            **{
                name: Judged(1, scale="exact", oracle=DENSIFY)
                for name in ("pruned", "cloned", "split", "count", "parent", "moments_kept")
            },
            "position_after": Judged(1, "scene unit", oracle=DENSIFY),
            "log_scale_after": Judged(1, oracle=DENSIFY),
        },
        "the parameters are those after the step of Adam; `d_mean2d` [view, axis, Gaussian] per px, `visible` [view,"
        " Gaussian], image `width` and `height`, `split_noise` as in `training`. `pruned`, `cloned`, `split` by old"
        " index; `count` Gaussians afterwards, `parent` their old index, `moments_kept` False for clones and children;"
        " where nothing is cloned or split the noise is not used",
    )
}
OPERATIONS = tuple(DECLARED)
VIEWS, COUNT = 3, 12


def _screen_gradients(seeds: Seeds) -> dict[str, Made]:
    """67 % of the Gaussians are steep; 0 is never visible, 1 is exactly on the threshold of 1/4."""
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


def _inputs(seeds: Seeds, moving: bool) -> dict[str, Made]:
    """An image of 16 x 8 pixels; a Gaussian of log-scale 0 is larger than 1 % of the extent."""
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


def density_spec(
    case: str, title: str, flags: tuple[str, ...], moving: bool = False, change: Any = None, **config: Any
) -> Spec:
    """One densification of the same Gaussians, with some settings."""
    inputs = _inputs(Seeds("density", case), moving)
    if change:
        change(inputs)
    density = written_section(DensityConfig(**{"gradient_threshold": 0.25, "extent": 30.0, **config}))
    settings = {"width": 16, "height": 8, "density": density | ({"extent": "cameras"} if moving else {})}
    return Spec("density", case, "density", title, flags, settings, inputs, ("d_mean2d",))


def spread_gradients(inputs: dict[str, Made]) -> None:
    """Gaussians that differ in their gradients, not in the order of the index: k / 8 + 1 / 4 times 1 / 4."""
    rank = permutation("density/spread", COUNT)
    size = np.zeros((VIEWS, 2, COUNT))
    size[:, 0] = (0.25 + rank / 8) / 4
    text = "(1/4 + rank / 8) / 4 in x, 0 in y, rank of the words of density/spread"
    inputs["d_mean2d"] = changed(inputs["d_mean2d"], ..., size, text)


def _decisions() -> list[Spec]:
    def tie(inputs: dict[str, Made]) -> None:
        d = inputs["d_mean2d"]
        d = changed(d, ..., d.array[:, :, :1] * 0 + 2.0**-3, "1/8 everywhere: all equally steep")
        inputs["d_mean2d"] = changed(d, (slice(None), slice(None), [8, 10]), 0.25, "Gaussians 8, 10: 1/4, the steepest")

    def faint(inputs: dict[str, Made]) -> None:
        inputs["opacity_logit"] = changed(inputs["opacity_logit"], ..., -7.0, "all -7")

    flags = ("density_over_all_views", "density_sum_of_views", "clone_and_split_swapped",
             "faint_ones_densified", "split_parent_kept", "children_not_smaller", "children_interleaved",
             "children_inherit_moments", "children_not_turned", "densify_threshold_in_pixels",
             "screen_gradient_without_half",
             "density_norm_of_sum", "candidates_above_the_threshold")  # fmt: skip
    return [
        density_spec("clone_split_prune", "Who is pruned, cloned and split, and in which order the new ones stand",
                     flags),
        density_spec("maximum", "No room for all: the steepest, equals by index", ("first_candidates_win",),
                     change=tie, maximum=14),
        density_spec("extent_of_cameras", "The extent that divides clones from splits, from moving cameras",
             ("extent_without_margin",), moving=True, dense_fraction=0.5),
        density_spec("all_pruned", "Nothing is left", ("faint_ones_densified",), change=faint),
    ]  # fmt: skip


def _on_the_thresholds() -> Spec:
    """Opacity 1/2 at a prune threshold of 1/2, largest axis 1 at a limit of 1: neither exceeds its threshold."""
    seeds, count = Seeds("density", "on_the_thresholds"), 6
    noise, turned = seeds.uniform("split_noise", -1.5, 1.5, 2, 3, count), pose()["rotation_matrix"]
    logit = seeds.uniform("opacity_logit", 0.5, 2.0, count)
    scale = seeds.uniform("log_scale", -2.0, -0.5, 3, count)
    inputs = {
        "position": seeds.uniform("position", -2.0, 2.0, 3, count, unit="scene unit"),
        "quaternion": seeds.uniform("quaternion", -1.0, 1.0, 4, count),
        "log_scale": changed(scale, (0, slice(1, 4)), [0.0, 0.0, 0.25], "[0, 1:4] is 0, 0, 1/4"),
        "opacity_logit": changed(logit, slice(0, 2), 0.0, "[0:2] is 0: opacity 1/2, the prune threshold"),
        "d_mean2d": given(np.stack([np.full((2, count), 2.0**-4), np.full((2, count), 2.0**-5)]),
                          "1/16 in view 0, 1/32 in view 1", "loss per px"),
        "visible": given(np.ones((2, count), bool), "all True"),
        "split_noise": noise,
        "rotation_matrices": given(np.stack([turned.array] * 2), f"{turned.recipe} for all"),
        "translations": given(np.zeros((2, 3)), "0"),
    }  # fmt: skip
    config = DensityConfig(gradient_threshold=0.25, extent=4.0, dense_fraction=0.25, prune_opacity=0.5)
    settings = {"width": 24, "height": 10, "density": written_section(config)}
    flags = ("prune_at_the_threshold", "split_at_the_limit", "density_width_for_height")
    return Spec("density", "on_the_thresholds", "density", "On the prune threshold it stays, on the size limit it is "
                "cloned; W of x and H of y", flags, settings, inputs, ("log_scale", "opacity_logit"))  # fmt: skip


def cases() -> list[Spec]:
    """Decisions, their order, and values on the thresholds."""
    return [*_decisions(), _on_the_thresholds()]
