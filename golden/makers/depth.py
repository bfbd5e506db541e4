"""Family `normalised_depth`: the depth loss (B8) of depths over their largest value.

Inputs: a rendered depth, a prior depth with holes and a tissue mask. The cases test the set of valid pixels (tissue
with a finite prior above 0), the pixels of the maximum, its gradient, the sharing of that gradient by ties, and the
zero loss below ten priors.
"""

import numpy as np

from makers.images import HEIGHT, WIDTH, spoiled, tool_mask
from makers.making import Made, Seeds, Spec, changed, given, scalar
from makers.operations import PER_LENGTH, Declared, Judged

DECLARED = {
    "normalised_depth": Declared(
        {
            "loss": Judged(1, oracle="depth.normalised_depth_forward"),
            "d_rendered_depth": Judged(2, PER_LENGTH, oracle="depth.normalised_depth_forward"),
        },
        "`d_loss` is the given derivative",
    )
}
OPERATIONS = tuple(DECLARED)


def _uniform(seeds: Seeds) -> dict[str, Made]:
    """Depths without a special value."""
    return {
        "rendered_depth": seeds.uniform("rendered_depth", 30.0, 70.0, HEIGHT, WIDTH, unit="scene unit"),
        "prior_depth": seeds.uniform("prior_depth", 40.0, 55.0, HEIGHT, WIDTH, unit="scene unit"),
        "mask": tool_mask(),
        "d_loss": scalar(1.5),
    }


def _with_holes(seeds: Seeds) -> dict[str, Made]:
    """Two pixels without a prior; the largest values are at excluded pixels."""
    inputs = _uniform(seeds)
    prior = changed(inputs["prior_depth"], ([0, 3], [0, 1]), [0.0, -1.0], "(0, 0) is 0, (3, 1) is -1: no depth")
    prior = changed(prior, (2, 13), 60.0, "(2, 13), an excluded pixel, is 60, the largest")
    depth = changed(inputs["rendered_depth"], (3, 12), 80.0, "(3, 12), an excluded pixel, is 80, the largest")
    return inputs | {"rendered_depth": depth, "prior_depth": prior}


def _in_row_6(prior: Made, count: int) -> Made:
    """A few priors and none elsewhere."""
    keep = np.zeros((HEIGHT, WIDTH))
    keep[6, :count] = prior.array[6, :count]
    return changed(prior, ..., keep, f"0 but row 6, columns 0..{count - 1}")


def _spec(case: str, title: str, flags: tuple[str, ...], inputs: dict[str, Made], *still: str) -> Spec:
    return Spec("normalised_depth", case, "normalised_depth", title, flags, {}, inputs, still)


def cases() -> list[Spec]:
    """Holes, ties, few priors; then priors and depths that are not finite or 0."""
    ties = _with_holes(Seeds("normalised_depth", "two_maxima"))
    ties["rendered_depth"] = changed(ties["rendered_depth"], (5, 3), 80.0, "(5, 3) is 80 too")
    few = _with_holes(Seeds("normalised_depth", "few_priors"))
    few["prior_depth"] = _in_row_6(few["prior_depth"], 9)
    odd = _uniform(Seeds("normalised_depth", "not_finite"))
    odd["prior_depth"] = changed(odd["prior_depth"], ([0, 6], [3, 9]), [np.inf, np.nan],
                                 "(0, 3) is infinite, (6, 9) is NaN: no depth")  # fmt: skip
    odd["rendered_depth"] = spoiled(odd["rendered_depth"], tool_mask())
    ten = _uniform(Seeds("normalised_depth", "ten_priors"))
    ten["prior_depth"] = _in_row_6(ten["prior_depth"], 10)
    empty = _uniform(Seeds("normalised_depth", "nothing_rendered"))
    empty["rendered_depth"] = given(np.zeros((HEIGHT, WIDTH)), "0", "scene unit")
    return [
        _spec("generic", "Both depths over their largest value, without holes; gradient to the maximum",
              ("depth_holes_count", "depth_maximum_constant", "depth_maximum_of_tissue", "depth_not_normalised"),
              _with_holes(Seeds("normalised_depth", "generic"))),
        _spec("two_maxima", "The gradient of the maximum is split evenly over ties",
              ("depth_first_maximum", "depth_every_maximum"), ties,
              "rendered_depth"),
        _spec("few_priors", "Fewer than ten priors say nothing", ("depth_few_priors",), few),
        _spec("not_finite", "Priors that are not finite are none; the largest depth is that of finite values",
              ("mask_multiplied", "infinite_prior_counts"), odd),
        _spec("ten_priors", "Ten priors are enough", ("ten_priors_ignored",), ten),
        _spec("nothing_rendered", "Nothing rendered: 0, no division by the largest depth", ("depth_over_zero",), empty),
    ]  # fmt: skip
