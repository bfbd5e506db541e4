"""Family `composite`, its thresholds: the cutoff and the clamp of alpha, and the stop at small transmittance (B5).

Most cases are flat over the image, so all pixels make the same decision. The values are just below, at and above a
threshold. Two cases are exactly on the cutoff, where rounding may decide either way: in one, some pixels may flip; in
the other, image and gradient must make the same decision.
"""

import math

from endotsr.method.splatting.settings import LEGACY, PAPER
from makers.making import Made, Seeds, Spec, changed, given
from makers.screens import flat_covariance, raster_settings, screen_inputs
from makers.views import logit_of

OPERATIONS = ("composite",)
CUTOFF = 1 / 255


def _flat(case: str, opacity: list[float], depth: list[float]) -> dict[str, Made]:
    inputs = screen_inputs(Seeds("composite", case), len(opacity), 4.0, 90.0)
    inputs |= {"covariance2d": flat_covariance(len(opacity)), "opacity_logit": logit_of(opacity)}
    return inputs | {"depth": given(depth, ", ".join(map(str, depth)), "scene unit")}


def _around_thresholds() -> list[Spec]:
    near, cut, paper = [3.0, 4.0, 5.0, 6.0, 7.0], CUTOFF, raster_settings(PAPER)
    return [
        Spec("composite", "alpha_cutoff", "composite", "Alpha a thousandth below and above 1/255",
             ("cutoff_missing", "cutoff_1_over_256"), paper,
             _flat("alpha_cutoff", [cut * 0.999, cut * 1.001, cut * 0.998, cut * 1.002, 0.3], near)),
        Spec("composite", "alpha_clamp", "composite", "Alpha below, at and above 0.99: gradient 0 where clamped",
             ("alpha_clamp_999", "alpha_clamp_missing", "clamped_alpha_gradient"), paper,
             _flat("alpha_clamp", [0.9895, 0.99002, 0.9985, 0.5, 0.9999], [7.0, 6.0, 5.0, 3.0, 4.0])),
        Spec("composite", "transmittance_stop", "composite", "Stop before T falls below 1e-4, not after",
             ("stop_missing", "stop_after", "stop_at_1e-3"), paper,
             _flat("transmittance_stop", [0.98, 0.98, 0.7, 0.1, 0.9, 0.6], [*near, 8.0]),
             without=("d_mean2d", "d_covariance2d")),
        _stop_ends_pixel(),
        _legacy_clamp(),
    ]  # fmt: skip


def _stop_ends_pixel() -> Spec:
    """Five Gaussians in the order of the index; the third stops every pixel."""
    inputs = _flat("stop_ends_pixel", [0.98, 0.98, 0.9, 0.5, 0.1], [3.0, 4.0, 5.0, 6.0, 7.0])
    inputs["depth"] = given([3.0, 4.0, 5.0, 6.0, 7.0], "3, 4, 5, 6, 7", "scene unit")
    title = "A weak Gaussian behind the one that stops is not drawn"
    return Spec("composite", "stop_ends_pixel", "composite", title, ("stop_skips", "stop_after"),
                raster_settings(PAPER), inputs,
                without=("d_mean2d", "d_covariance2d"))  # fmt: skip


def _legacy_clamp() -> Spec:
    inputs = screen_inputs(Seeds("composite", "legacy_clamp"), 5, 60.0, 400.0)
    inputs["opacity_logit"] = logit_of([0.9999, 0.995, 0.9, 0.999, 0.5])
    return Spec("composite", "legacy_clamp", "composite", "Preset legacy: the gradient passes the clamp of alpha",
                ("clamp_blocks_legacy",), raster_settings(LEGACY), inputs)  # fmt: skip


def _on_the_cutoff() -> Spec:
    """Peaks at 1/255, each at a pixel centre."""
    inputs = screen_inputs(Seeds("composite", "on_the_cutoff"), 5, 4.0, 6.0)
    middles = [[2.5, 6.5, 9.5, 13.5, 16.5], [3.5, 9.5, 5.5, 10.5, 2.5]]
    inputs |= {"mean2d": given(middles, "pixel centres", "px"), "opacity_logit": logit_of([CUTOFF] * 5)}
    names = ("mean2d", "covariance2d", "opacity_logit", "colour", "depth", "background")
    return Spec("composite", "on_the_cutoff", "composite", "Peaks of alpha at 1/255: each may be drawn or not",
                ("cutoff_missing",), raster_settings(PAPER), inputs, ("opacity_logit", "mean2d", "covariance2d"),
                without=tuple(f"d_{name}" for name in names), flip_budget=5)  # fmt: skip


def _one_on_the_cutoff() -> Spec:
    """One decision that depends on rounding and determines the whole answer, gradients included."""
    inputs, settings = screen_inputs(Seeds("composite", "one_on_the_cutoff"), 3, 4.0, 90.0), raster_settings(PAPER)
    one = (slice(None), 1)
    inputs["mean2d"] = changed(inputs["mean2d"], one, [9.5, 6.5], "[:, 1] is (9.5, 6.5), a pixel centre")
    inputs["covariance2d"] = changed(inputs["covariance2d"], one, [1.5, 0.25, 2.0], "[:, 1] is 1.5, 0.25, 2")
    inputs["opacity_logit"] = changed(
        inputs["opacity_logit"], 1, -math.log(254.0), "[1] is -log 254, rounded: opacity 1/255 - 7e-10"
    )
    drawn = settings | {"raster": settings["raster"] | {"alpha_cutoff": (1 - 1e-5) / 255}}
    title = "One peak of alpha at 1/255: drawn or not, but the same in image and gradient"
    return Spec("composite", "one_on_the_cutoff", "composite", title, ("cutoff_decided_twice",), settings, inputs,
                ("opacity_logit", "mean2d", "covariance2d"), either=(drawn,))  # fmt: skip


def cases() -> list[Spec]:
    """Values around each threshold, then on the cutoff."""
    return [*_around_thresholds(), _on_the_cutoff(), _one_on_the_cutoff()]
