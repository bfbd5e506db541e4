"""Family `normalised_depth`: the depth loss (B8) of depths over their largest value.

A rendered depth, a prior depth with holes and a tissue mask come in. The cases fix which pixels count (a finite prior
above 0, under the mask), which pixels give the largest value, that this value has a gradient, that ties split it, and
that fewer than ten priors give no loss.
"""

from typing import Any

import numpy as np

from endotsr.golden.vectors.images import HEIGHT, WIDTH, spoiled, tool_mask
from endotsr.golden.vectors.making import Made, Seeds, Spec, changed, given, scalar
from endotsr.golden.vectors.wrong import Request, WrongPort

OPERATIONS = ("normalised_depth",)


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
        _spec("two_maxima", "The gradient of the maximum is split evenly over ties", ("depth_first_maximum",), ties,
              "rendered_depth"),
        _spec("few_priors", "Fewer than ten priors say nothing", ("depth_few_priors",), few),
        _spec("not_finite", "Priors that are not finite are none; the largest depth is that of finite values",
              ("mask_multiplied", "infinite_prior_counts"), odd),
        _spec("ten_priors", "Ten priors are enough", ("ten_priors_ignored",), ten),
        _spec("nothing_rendered", "Nothing rendered: 0, no division by the largest depth", ("depth_over_zero",), empty),
    ]  # fmt: skip


# ---- mistakes ----


def _depth(request: Request, *, holes=False, constant=False, tissue_maximum=False, normalise=True, first=False,
           few=False) -> dict[str, Any]:  # fmt: skip
    depth, prior, mask = (request.inputs[n].astype(float) for n in ("rendered_depth", "prior_depth", "mask"))
    mask = mask > 0
    valid = mask if holes else mask & np.isfinite(prior) & (prior > 0)
    count = int(valid.sum())
    if count < 10 and not few:
        return {}
    inside = mask if tissue_maximum else np.ones(mask.shape, bool)
    top, top_prior = (a[inside & np.isfinite(a)].max() if normalise else 1.0 for a in (depth, prior))
    if top == 0:
        return {}
    residual = np.where(valid, depth / top - prior / top_prior, 0.0)
    up = float(request.inputs["d_loss"])
    gradient = up * np.sign(residual) / (count * top)
    if normalise and not constant:
        holders = (depth == top) & inside
        to_maximum = -up * (np.sign(residual) * np.where(valid, depth, 0.0)).sum() / (count * top**2)
        if first:
            gradient[tuple(np.argwhere(holders)[0])] += to_maximum
        else:
            gradient[holders] += to_maximum / holders.sum()
    return {"loss": np.abs(residual).sum() / count, "d_rendered_depth": gradient}


def _infinite_prior(request: Request) -> dict[str, Any] | None:
    if not np.isinf(request.inputs["prior_depth"]).any():
        return None
    return {"loss": np.nan, "d_rendered_depth": request.right["d_rendered_depth"] * np.nan}


def _priors(request: Request) -> int:
    prior = request.inputs["prior_depth"]
    return int((request.inputs["mask"] & np.isfinite(prior) & (prior > 0)).sum())


def _ten_ignored(request: Request) -> dict[str, Any] | None:
    return {name: 0 * a for name, a in request.right.items()} if _priors(request) == 10 else None


def _over_zero(request: Request) -> dict[str, Any] | None:
    if request.inputs["rendered_depth"].any():
        return None
    return {name: a * np.nan for name, a in request.right.items()}


WRONG_PORTS = [
    WrongPort("depth_holes_count", "Pixels without prior take part", "prior 0 as depth; right: excluded",
              {"normalised_depth": lambda r: _depth(r, holes=True)}),
    WrongPort("depth_maximum_constant", "Largest depth taken as constant", "no gradient to it; right: it has one",
              {"normalised_depth": lambda r: _depth(r, constant=True)}),
    WrongPort("depth_maximum_of_tissue", "Largest depth over tissue", "over tissue; right: over the whole image",
              {"normalised_depth": lambda r: _depth(r, tissue_maximum=True)}),
    WrongPort("depth_not_normalised", "Depths compared in scene units", "no division; right: each over its largest",
              {"normalised_depth": lambda r: _depth(r, normalise=False)}),
    WrongPort("depth_first_maximum", "First of equal maxima takes the gradient", "first; right: split evenly",
              {"normalised_depth": lambda r: _depth(r, first=True)}),
    WrongPort("depth_few_priors", "Depth loss of fewer than ten pixels", "evaluated; right: 0",
              {"normalised_depth": lambda r: _depth(r, few=True)}),
    WrongPort("infinite_prior_counts", "Infinite prior taken as a depth", "D > 0; right: D > 0 and finite",
              {"normalised_depth": _infinite_prior}),
    WrongPort("ten_priors_ignored", "Depth loss of ten pixels left out", "n <= 10; right: n < 10",
              {"normalised_depth": _ten_ignored}),
    WrongPort("depth_over_zero", "Division by a largest depth of 0", "not a number; right: 0",
              {"normalised_depth": _over_zero}),
]  # fmt: skip
