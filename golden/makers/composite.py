"""Family `composite`: blending of screen Gaussians (B5) and its gradients; `composite_limits` has its thresholds.

Screen means, screen covariances, logits, colours, depths, a background and gradients by the three images come in. The
cases fix the order (by depth, ties by index), the background, the place of pixel centres, the reach of tiles in preset
legacy, and gradients that need no division by 1 - alpha.
"""

import numpy as np

from endotsr.splatting.settings import EXACT, LEGACY, PAPER
from makers.copies import Edit
from makers.making import Seeds, Spec, given
from makers.screens import flat_covariance, raster_settings, screen_inputs
from makers.views import PRESETS, logit_of
from makers.wrong import edit, port, with_raster

OPERATIONS = ("composite",)


def _preset(name: str) -> Spec:
    flags = ("order_by_index", "order_reversed", "depth_over_opacity", "background_missing", "pixel_corner_sample",
             "depth_gradient_dropped", "alpha_gradient_without_rest", "covariance_off_diagonal_half",
             "alpha_gradient_without_background", "opacity_gradient_without_sigmoid")  # fmt: skip
    if name == "legacy":
        flags = tuple(flag for flag in flags if flag != "depth_gradient_dropped")
    inputs = screen_inputs(Seeds("composite", name), 8, 4.0, 90.0)
    title = f"Preset {name}: overlapping Gaussians, depth order unlike index order"
    return Spec("composite", name, "composite", title, flags, raster_settings(PRESETS[name]), inputs)


def _equal_depths() -> Spec:
    depths = [4.0, 4.0, 3.0, 4.0, 4.0]
    inputs = screen_inputs(Seeds("composite", "equal_depths"), 5, 4.0, 90.0)
    inputs |= {"covariance2d": flat_covariance(5), "opacity_logit": logit_of([0.3, 0.4, 0.5, 0.6, 0.7])}
    inputs["depth"] = given(depths, ", ".join(map(str, depths)), "scene unit")
    return Spec("composite", "equal_depths", "composite", "Equal depths keep the order of the index",
                ("ties_reversed",), raster_settings(PAPER), inputs, ("depth",))  # fmt: skip


def _opaque_exact() -> Spec:
    inputs = screen_inputs(Seeds("composite", "opaque_exact"), 4, 1.0, 4.0)
    wide = np.array([[1e18, 9.0, 9.0, 9.0], [0.0] * 4, [1e18, 9.0, 9.0, 9.0]])
    inputs |= {
        "opacity_logit": given([40.0, -40.0, 2.0, 40.0], "40, -40, 2, 40"),
        "covariance2d": given(wide, "a = c = 1e18, 9, 9, 9; b = 0", "px^2"),
        "depth": given([4.0, 5.0, 3.0, 6.0], "4, 5, 3, 6", "scene unit"),
    }
    return Spec("composite", "opaque_exact", "composite", "Alpha of 1 in front: no division by 1 - alpha",
                ("divide_by_one_minus_alpha",), raster_settings(EXACT), inputs, without=("d_background",))  # fmt: skip


def _tile_case(
    case: str, title: str, flags: tuple[str, ...], u: list[float], v: list[float], size: list[float]
) -> Spec:
    """Three discs in preset legacy, with their centres and the variances of their axes."""
    seeds, (width, height) = Seeds("composite", case), (48, 20)
    shapes = {
        "d_colour_image": (3, height, width),
        "d_depth_image": (height, width),
        "d_opacity_image": (height, width),
    }
    centres = ", ".join(f"({x:g}, {y:g})" for x, y in zip(u, v, strict=True))
    inputs = {
        "mean2d": given([u, v], centres, "px"),
        "covariance2d": given([size, [0.0] * 3, size], f"a = c = {', '.join(f'{a:g}' for a in size)}; b = 0", "px^2"),
        "opacity_logit": logit_of([0.95, 0.9, 0.97]),
        "colour": seeds.uniform("colour", 0.1, 1.0, 3, 3, unit="display"),
        "depth": given([5.0, 4.0, 3.0], "5, 4, 3", "scene unit"),
        "background": seeds.uniform("background", 0.1, 0.9, 3, unit="display"),
        **{name: seeds.uniform(name, -1.0, 1.0, *shape) for name, shape in shapes.items()},
    }
    settings = raster_settings(LEGACY) | {"width": width, "height": height}
    return Spec("composite", case, "composite", title, flags, settings, inputs)


def _tile_ends() -> list[Spec]:
    """Discs whose radius or centre puts the end of their tiles between the right rule and a wrong one.

    3 sqrt(2.458 + sqrt(0.1)) is 4.997: a larger number under the inner root makes the radius 6 in place of 5.
    """
    flags = ("tiles_from_the_mean", "tiles_root_without_floor", "tiles_unbounded")
    ends = "Where the tiles of a Gaussian end: centre less half a pixel, the root at least 0.1"
    return [
        _tile_case("tiles", ends, flags, [46.75, 47.25, 24.3], [8.2, 11.7, 10.25], [99.9, 99.9, 4.0]),
        _tile_case("tile_root", "A disc whose radius is just below 5: no more than 0.1 stands under the root",
                   ("tiles_unbounded",), [12.0, 30.0, 28.0], [10.2, 9.4, 6.5], [2.458, 9.0, 30.0]),
    ]  # fmt: skip


def cases() -> list[Spec]:
    """The three presets, equal depths, opaque Gaussians, the ends of tiles."""
    return [*(_preset(name) for name in PRESETS), _equal_depths(), _opaque_exact(), *_tile_ends()]


# ---- mistakes ----

SOURCE, RECORDS, BINNING = "splatting.compositing", "splatting.records", "splatting.binning"
BOTH, ALL = "composite render", "composite render objective"
ORDER = "return _radix_kernel(depth.view(np.uint32 if depth.dtype == np.float32 else np.uint64), visible)"


def _order(by: str) -> Edit:
    """Another order, of the indices `seen` of the visible Gaussians."""
    return edit(BINNING, ORDER, f"seen = np.flatnonzero(visible)\n    return seen[{by}].astype(np.int32)")


NORMALISED = (
    edit(SOURCE, "= z, total, t\n", "= (z / total if total > zero else z), total, t\n"),
    edit(SOURCE, "                t, n = one, 0\n", "                t, n, far, covered = one, 0, zero, zero\n"),
    edit(
        SOURCE,
        "                    hit[n] = p\n",
        "                    hit[n] = p\n"
        "                    far += alpha * t * records[ranks[first + p]][DEPTH]\n"
        "                    covered += alpha * t\n",
    ),
    edit(
        SOURCE,
        "gz, go = d_depth[row, column], d_opacity[row, column]\n",
        "gz, go = d_depth[row, column], d_opacity[row, column]\n"
        "                if covered > zero:\n"
        "                    gz, go = gz / covered, go - gz * far / (covered * covered)\n",
    ),
)
DIVIDED = (
    edit(
        SOURCE,
        "rest = g0 * background[0] + g1 * background[1] + g2 * background[2]",
        "rest = t * (g0 * background[0] + g1 * background[1] + g2 * background[2])",
    ),
    edit(SOURCE, "(t * (own - rest))", "(t * own - rest / (one - alpha))"),
    edit(SOURCE, "rest = alpha * own + (one - alpha) * rest", "rest = rest + alpha * t * own"),
)
HALF = "factor * (-half * total[SUM_SYY])\n"

WRONG_PORTS = [
    port(
        "pixel_corner_sample",
        "Pixels sampled at their corner",
        "at i; right: at i + 1/2",
        BOTH,
        edit(SOURCE, "real(column) + half, real(row) + half", "real(column), real(row)", 2),
    ),
    port("order_by_index", "Composited in index order", "index; right: view depth", ALL, _order(":")),
    port(
        "order_reversed",
        "Composited back to front",
        "far first; right: near first",
        ALL,
        _order('np.argsort(-depth[seen], kind="stable")'),
    ),
    port(
        "ties_reversed",
        "Equal depths in reverse order",
        "last index first; right: index order",
        ALL,
        _order("np.lexsort((-seen, depth[seen]))"),
    ),
    port("depth_over_opacity", "Depth divided by opacity", "normalised; right: the sum", BOTH, *NORMALISED),
    port(
        "background_missing",
        "Background left out",
        "0; right: T times background",
        BOTH,
        *(edit(SOURCE, f"{name} + t * background[{k}]", name) for k, name in enumerate(("red", "green", "blue"))),
        edit(SOURCE, "rest = g0 * background[0] + g1 * background[1] + g2 * background[2]", "rest = zero"),
        edit(SOURCE, 'np.einsum("chw,hw->c", d_colour, transmittance)', "np.zeros(3, d_colour.dtype)"),
    ),
    port(
        "alpha_gradient_without_rest",
        "Gradient of alpha without what stands behind",
        "own colour only; right: own minus the rest",
        BOTH,
        edit(SOURCE, "(t * (own - rest))", "(t * own)"),
    ),
    port(
        "alpha_gradient_without_background",
        "Gradient of alpha without the background",
        "own minus the Gaussians behind; right: and minus the background",
        BOTH,
        edit(SOURCE, "rest = g0 * background[0] + g1 * background[1] + g2 * background[2]", "rest = zero"),
    ),
    port(
        "covariance_off_diagonal_half",
        "Half the off-diagonal gradient",
        "d/db of one entry; right: of both",
        BOTH,
        edit(
            RECORDS,
            HALF,
            HALF + "        g_b = (a * a + a * a) * m * d_footprint[0, i] + r * d_footprint[1, i]\n"
            "        d_footprint[1, i] -= half * g_b / r\n"
            "        d_footprint[2, i] += half * m * g_b / (r * r)\n",
        ),
    ),
    port(
        "depth_gradient_dropped",
        "Depth image sends no gradient to z",
        "0; right: alpha T",
        ALL,
        with_raster("deviations=found.deviations._replace(drop_depth_to_z=True)"),
    ),
    port(
        "opacity_gradient_without_sigmoid",
        "Gradient by the opacity, not by its logit",
        "g; right: o (1 - o) g",
        BOTH,
        edit(
            RECORDS,
            "d_logit[i] = total[SUM_S] / (one + exponential(min(opacity_logit[i], largest)))",
            "d_logit[i] = total[SUM_S] * (one + exponential(-opacity_logit[i]))",
        ),
    ),
    port(
        "deviations_off",
        "Exact gradients in preset legacy",
        "exact; right: the released code's",
        "projection composite render objective",
        edit("stages.requests", 'LegacyDeviations(**fields["deviations"])', "LegacyDeviations()"),
    ),
    port(
        "divide_by_one_minus_alpha",
        "Reverse pass divides by 1 - alpha",
        "0 / 0 at alpha = 1; right: recursion",
        "composite",
        *DIVIDED,
    ),
    port(
        "tiles_from_the_mean",
        "Tiles counted from the mean",
        "u; right: u - 1/2",
        BOTH,
        *(edit(BINNING, f"({name} - half {sign} radius", f"({name} {sign} radius") for name in "xy" for sign in "+-"),
    ),
    port(
        "tiles_root_without_floor",
        "Radius of the tiles without its floor",
        "max(0, .); right: max(0.1, .)",
        BOTH,
        edit(BINNING, "max(tenth, middle", "max(zero, middle"),
    ),
    port(
        "tiles_unbounded",
        "Every Gaussian at every pixel in preset legacy",
        "no tiles; right: tiles of three sigma",
        BOTH,
        edit(
            BINNING,
            "support = settings.support if",
            'support = settings.support.replace("three_sigma_tiles", "everywhere") if',
        ),
    ),
]
