"""Golden cases of the base losses (B6) to (B9)."""

import numpy as np

from endotsr.golden.cases import Seeds, Spec
from endotsr.golden.cases_equations import scalar
from endotsr.golden.generator import Made, changed, given

HEIGHT, WIDTH = 9, 14


def tool_mask() -> Made:
    """A tool that reaches in from the right, and one excluded pixel alone."""
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


def _pair(seeds: Seeds, gap: float = 0.35) -> dict[str, Made]:
    shape = (3, HEIGHT, WIDTH)
    observed = seeds.uniform("observed", 0.0, 0.5, *shape, unit="display")
    step = seeds.uniform("step", 0.05, gap, *shape)
    rendered = given(observed.array + step.array, f"observed + {step.recipe}", "display")
    flip = (np.indices(shape).sum(axis=0) % 3) == 0
    rendered = changed(rendered, flip, (observed.array - step.array)[flip], "minus in place of plus where "
                       "(c + y + x) % 3 == 0")  # fmt: skip
    return {"rendered": rendered, "observed": observed}


def _photometric() -> list[Spec]:
    out = []
    for family, name in (("masked_l1", "d_loss"), ("masked_ssim", "d_ssim")):
        mean = "l1_over_all_pixels" if family == "masked_l1" else "ssim_over_all_pixels"
        many = (
            (mean, "l1_sum_over_channels", "mask_inverted_loss")
            if family == "masked_l1"
            else (mean, "ssim_of_unmasked_images", "ssim_window_7", "ssim_reflect_border", "mask_inverted_loss")
        )
        for case, mask, title, flags in (
            ("generic", tool_mask(), "Mean over tissue pixels and channels", many),
            ("one_pixel", one_pixel(), "One pixel of tissue", (mean,)),
            ("no_tissue", nothing(), "No tissue: a defined value, not NaN", ("mean_of_nothing",)),
        ):
            inputs = {**_pair(Seeds(family, case)), "mask": mask, name: scalar(1.25)}
            out.append(Spec(family, case, family, title, flags, {}, inputs))
        same = Seeds(family, "equal").uniform("observed", 0.0, 1.0, 3, HEIGHT, WIDTH, unit="display")
        inputs = {"rendered": same, "observed": same, "mask": tool_mask(), name: scalar(1.0)}
        flags = ("sign_of_zero",) if family == "masked_l1" else ()
        out.append(Spec(family, "equal", family, "Equal images have gradient exactly 0", flags, {}, inputs,
                        ("rendered", "observed")))  # fmt: skip
    return out


def _depth_inputs(seeds: Seeds) -> dict[str, Made]:
    prior = seeds.uniform("prior_depth", 40.0, 55.0, HEIGHT, WIDTH, unit="scene unit")
    prior = changed(prior, ([0, 3], [0, 1]), [0.0, -1.0], "(0, 0) is 0, (3, 1) is -1: no depth")
    prior = changed(prior, (2, 13), 60.0, "(2, 13), an excluded pixel, is 60, the largest")
    depth = seeds.uniform("rendered_depth", 30.0, 70.0, HEIGHT, WIDTH, unit="scene unit")
    depth = changed(depth, (3, 12), 80.0, "(3, 12), an excluded pixel, is 80, the largest")
    return {"rendered_depth": depth, "prior_depth": prior, "mask": tool_mask(), "d_loss": scalar(1.5)}


def _depth() -> list[Spec]:
    generic = _depth_inputs(Seeds("normalised_depth", "generic"))
    ties = _depth_inputs(Seeds("normalised_depth", "two_maxima"))
    ties["rendered_depth"] = changed(ties["rendered_depth"], (5, 3), 80.0, "(5, 3) is 80 too")
    few = _depth_inputs(Seeds("normalised_depth", "few_priors"))
    keep = np.zeros((HEIGHT, WIDTH))
    keep[6, :9] = few["prior_depth"].array[6, :9]
    few["prior_depth"] = changed(few["prior_depth"], ..., keep, "0 but row 6, columns 0..8")
    flags = ("depth_holes_count", "depth_maximum_constant", "depth_maximum_of_tissue", "depth_not_normalised")
    name, rows = "normalised_depth", [
        ("generic", "Both depths over their largest value, without holes; gradient to the maximum", flags, generic, ()),
        ("two_maxima", "The gradient of the maximum is split evenly over ties", ("depth_first_maximum",), ties,
         ("rendered_depth",)),
        ("few_priors", "Fewer than ten priors say nothing", ("depth_few_priors",), few, ()),
    ]  # fmt: skip
    return [Spec(name, case, name, title, flags, {}, inputs, still) for case, title, flags, inputs, still in rows]


def _smoothness() -> list[Spec]:
    out = []
    edges = np.zeros((HEIGHT, WIDTH), bool)
    edges[1:8, 4] = True
    rows = [
        (
            "generic",
            tool_mask(),
            "Squared steps of smooth tissue, total variation outside",
            ("edges_ignored", "variation_of_tissue", "smoothness_on_all_pixels"),
        ),
        (
            "all_tissue",
            given(np.ones((HEIGHT, WIDTH), bool), "all True"),
            "All tissue: no total variation",
            ("variation_of_tissue", "edges_ignored"),
        ),
        ("no_tissue", nothing(), "No tissue: total variation alone", ("variation_of_tissue",)),
    ]
    for case, mask, title, flags in rows:
        seeds = Seeds("smoothness", case)
        inputs = {
            "rendered_depth": seeds.uniform("rendered_depth", 1.0, 3.0, HEIGHT, WIDTH, unit="scene unit"),
            "rendered": seeds.uniform("rendered", 0.1, 0.9, 3, HEIGHT, WIDTH, unit="display"),
            "mask": mask,
            "edges": given(edges, "True in column 4, rows 1..7"),
            "d_loss": scalar(0.5),
        }
        out.append(Spec("smoothness", case, "smoothness", title, flags, {"total_variation_factor": 3.0}, inputs))
    return out


def cases() -> list[Spec]:
    """All of them."""
    return [*_photometric(), *_depth(), *_smoothness()]
