"""The settings between exact and fast: a joint sweep of precision, cutoff and transmittance stop, and the presets."""

import itertools
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Literal, NamedTuple

from endotsr.method.splatting.render import Compositor
from endotsr.method.splatting.settings import EXACT, PRESETS, RasterSettings

Precision = Literal["float32", "float64"]


class Setting(NamedTuple):
    """One way to render a frame."""

    precision: Precision = "float64"
    raster: RasterSettings = EXACT
    degree: int = 3  # highest harmonic degree
    scale: float = 1.0  # of the rendered picture, which is then upsampled
    bases: int | None = None  # time bases of the FDM to keep; None = all
    frequencies: int | None = None  # Fourier frequencies to keep, lowest first; None = all
    compositor: Compositor = "auto"
    threads: int | None = None  # None = unchanged
    kernels: Callable[[], AbstractContextManager[object]] = nullcontext  # context of every frame


# exact except for the cutoff and the clamp of alpha
CLOSE = EXACT._replace(support="ellipse", alpha_cutoff=1e-9, alpha_max=1 - 2**-20)
ACCURATE = Setting(raster=CLOSE)
CUTOFFS = {"1e-12": 1e-12, "1e-9": 1e-9, "1e-7": 1e-7, "1e-5": 1e-5, "1e-4": 1e-4, "1/1024": 1 / 1024, "1/255": 1 / 255,
           "1/64": 1 / 64}  # fmt: skip
STOPS = {"0": 0.0, "1e-8": 1e-8, "1e-6": 1e-6, "1e-4": 1e-4, "1e-3": 1e-3, "1e-2": 1e-2}


def joint(degree: int, near: float) -> dict[str, Setting]:
    """Precision x cutoff x stop; those in float32 with a cutoff from 1/255 on and the stop 1e-3 also at half size."""
    found = {}
    stops = {name: STOPS[name] for name in ("1e-6", "1e-4", "1e-3", "1e-2")}
    for precision, cutoff, stop in itertools.product(("float64", "float32"), CUTOFFS, stops):
        raster = CLOSE._replace(near=near, alpha_cutoff=CUTOFFS[cutoff], transmittance_stop=stops[stop])
        label = f"{precision}, cutoff {cutoff}, stop {stop}"
        found[label] = Setting(precision, raster, degree)
        if precision == "float32" and CUTOFFS[cutoff] >= 1 / 255 and stop == "1e-3":
            found[f"{label}, half resolution"] = found[label]._replace(scale=0.5)
    return found


def presets(degree: int, near: float) -> dict[str, Setting]:
    """The presets of the rasteriser, each in its intended precision."""
    precisions: dict[str, Precision] = {"exact": "float64", "paper": "float32", "legacy": "float32"}
    return {
        name: Setting(precision, PRESETS[name]._replace(near=near), degree) for name, precision in precisions.items()
    }
