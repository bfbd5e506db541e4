"""Masks and image pairs, and the cases common to all masked means over an image."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from makers.making import Made, Seeds, Spec, changed, given, scalar

HEIGHT, WIDTH = 9, 14
NOT_FINITE = "not_finite_under_mask"


def tissue(height: int, width: int, rows: int, columns: int) -> Made:
    """An instrument in the lower right corner."""
    y, x = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    text = f"y < {height - rows} or x < {width - columns}"
    return given((y < height - rows) | (x < width - columns), text)


def tool_mask() -> Made:
    """An instrument that enters from the right, and one isolated excluded pixel."""
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[2:5, 8:] = False
    mask[7, 2] = False
    return given(mask, "True but rows 2..4 from column 8 on, and (7, 2)")


def one_pixel() -> Made:
    """One pixel of tissue."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[4, 5] = True
    return given(mask, "True at (4, 5) only")


def nothing() -> Made:
    """No tissue."""
    return given(np.zeros((HEIGHT, WIDTH), bool), "all False")


def two_images(seeds: Seeds) -> dict[str, Made]:
    """A rendered image that differs from the observed one everywhere, by 0.05 to 0.35 in either direction."""
    shape = (3, HEIGHT, WIDTH)
    observed = seeds.uniform("observed", 0.0, 0.5, *shape, unit="display")
    step = seeds.uniform("step", 0.05, 0.35, *shape)
    rendered = given(observed.array + step.array, f"observed + {step.recipe}", "display")
    flip = (np.indices(shape).sum(axis=0) % 3) == 0
    rendered = changed(rendered, flip, (observed.array - step.array)[flip], "minus in place of plus where "
                       "(c + y + x) % 3 == 0")  # fmt: skip
    return {"rendered": rendered, "observed": observed}


def equal_images(seeds: Seeds) -> dict[str, Made]:
    """A rendered image equal to the observed one."""
    same = seeds.uniform("observed", 0.0, 1.0, 3, HEIGHT, WIDTH, unit="display")
    return {"rendered": same, "observed": same}


def not_finite_images(seeds: Seeds) -> dict[str, Made]:
    """Two images with non-finite numbers where `tool_mask` is False."""
    images = {n: seeds.uniform(n, 0.0, 1.0, 3, HEIGHT, WIDTH, unit="display") for n in ("rendered", "observed")}
    return {name: spoiled(made, tool_mask()) for name, made in images.items()}


def spoiled(made: Made, mask: Made) -> Made:
    """NaN and infinity alternating at excluded pixels."""
    holes = np.where(np.arange(mask.array.size).reshape(mask.array.shape) % 2 > 0, np.inf, np.nan)
    values = np.where(mask.array, made.array, holes)
    return changed(made, ..., values, "where the mask is False: NaN at even pixels, infinity at odd ones, "
                   "counted row by row from 0")  # fmt: skip


def masked_mean(
    family: str,
    gradient: str,
    generic: tuple[str, ...],
    one_pixel_only: tuple[str, ...],
    equal: tuple[str, ...],
    settings: Mapping[str, Any] | None = None,
) -> list[Spec]:
    """The five cases of a mean over tissue pixels, with settings of the operation.

    `gradient` names the input d_loss, and the tuples are mistakes.
    """

    def spec(case: str, title: str, flags: tuple[str, ...], images: dict[str, Made], mask: Made, d_loss=1.25, still=()):
        inputs = images | {"mask": mask, gradient: scalar(d_loss)}
        return Spec(family, case, family, title, flags, dict(settings or {}), inputs, still)

    seeds = {case: Seeds(family, case) for case in ("generic", "one_pixel", "no_tissue", "equal", NOT_FINITE)}
    return [
        spec("generic", "Mean over tissue pixels and channels", generic, two_images(seeds["generic"]), tool_mask()),
        spec("one_pixel", "One pixel of tissue", one_pixel_only, two_images(seeds["one_pixel"]), one_pixel()),
        spec("no_tissue", "No tissue: a defined value, not NaN", ("mean_of_nothing",), two_images(seeds["no_tissue"]),
             nothing()),
        spec("equal", "Equal images have gradient exactly 0", equal, equal_images(seeds["equal"]), tool_mask(), 1.0,
             ("rendered", "observed")),
        spec(NOT_FINITE, "NaN and infinity under the mask change nothing", ("mask_multiplied",),
             not_finite_images(seeds[NOT_FINITE]), tool_mask()),
    ]  # fmt: skip
