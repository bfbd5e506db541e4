"""The dials between exact and fast: their measured values, and what is left out and why.

Each dial is varied alone, with accurate values for everything else; a joint sweep then varies the three most important
ones together.
"""

import itertools
from typing import Literal, NamedTuple

from endotsr.splatting.render import Compositor
from endotsr.splatting.settings import EXACT, PRESETS, RasterSettings

Precision = Literal["float32", "float64"]


class Setting(NamedTuple):
    """One way to render a frame."""

    precision: Precision = "float64"
    raster: RasterSettings = EXACT
    degree: int = 3  # highest harmonic degree
    scale: float = 1.0  # of the picture that is rendered; it is then up-sampled
    bases: int | None = None  # time bases of the FDM that are kept; None = all
    frequencies: int | None = None  # Fourier frequencies that are kept, lowest first; None = all
    compositor: Compositor = "auto"
    exponential: int | None = None  # degree of the polynomial for 2^x; None = that of the path
    tile: int | None = None  # side of the tiles of the path `definition`; None = 16
    threads: int | None = None  # None = those of the run


class Dial(NamedTuple):
    """One setting varied, the others fixed."""

    name: str
    title: str
    cost: str  # machine-independent cost: `visits` or `terms`
    values: dict[str, Setting]  # by label, from accurate to fast
    lossless: bool = False  # must not change a bit of the image


CLOSE = EXACT._replace(support="ellipse", alpha_cutoff=1e-9, alpha_max=1 - 2**-20)  # exact but for a 1e-9 cutoff
ACCURATE = Setting(raster=CLOSE)
CUTOFFS = {"1e-12": 1e-12, "1e-9": 1e-9, "1e-7": 1e-7, "1e-5": 1e-5, "1e-4": 1e-4, "1/1024": 1 / 1024, "1/255": 1 / 255,
           "1/64": 1 / 64}  # fmt: skip
STOPS = {"0": 0.0, "1e-8": 1e-8, "1e-6": 1e-6, "1e-4": 1e-4, "1e-3": 1e-3, "1e-2": 1e-2}
CLAMPS = {"none": CLOSE.alpha_max, "0.999": 0.999, "0.99": 0.99, "0.95": 0.95}
EXPONENTIALS = (3, 5, 7)  # degrees beside the built-in 11
TILES = (8, 16, 32)

OMITTED = {
    "low-pass of 0.3 px^2, near plane": "they change the model, not the arithmetic: there is no error to speak of",
    "off-axis clamp of the Jacobian": "part of the presets; it acts on Gaussians outside the picture only",
    "culling": "exact in every setting: a Gaussian that reaches no pixel is never visited",
    "reuse of the depth order between frames": "not offered: the order is exact in every frame",
    "T stored or replayed in the reverse pass": "fixed by the compositor: `definition` keeps T, `blocks` replays it",
    "tile size of the fast path": "64x16 pixels, a constant that its vector code is compiled for; "
    "the dial turns the tiles of `definition`",
    "fast-math": "not offered: sums keep their order, so that results repeat bit for bit",
}


def dials(degree: int, bases: int, frequencies: int, near: float) -> list[Dial]:
    """All dials that apply to a scene, each varied from `ACCURATE`.

    degree, bases, frequencies   of the trained scene; 0 bases or frequencies: it has no such component
    near                         near plane, scene units
    """
    base = ACCURATE._replace(raster=CLOSE._replace(near=near), degree=degree)
    paper = base.raster._replace(alpha_cutoff=1 / 255)
    found = [
        Dial("precision", "precision", "visits", {p: base._replace(precision=p) for p in ("float64", "float32")}),
        Dial("cutoff", "alpha cutoff", "visits", _raster(base, "alpha_cutoff", CUTOFFS)),
        Dial("stop", "transmittance stop", "visits", _raster(base, "transmittance_stop", STOPS)),
        Dial("clamp", "alpha clamp", "visits", _raster(base, "alpha_max", CLAMPS)),
        Dial("support", "support rule, at cutoff 1/255", "visits", _supports(base, paper)),
        Dial("exponential", "exponential", "visits", _exponentials(base)),
    ]
    if degree > 0:
        degrees = {str(d): base._replace(degree=d) for d in range(degree, -1, -1)}
        found.append(Dial("harmonics", "harmonic degree", "visits", degrees))
    scales = {f"{s:g}": base._replace(scale=s) for s in (1.0, 0.75, 0.5, 0.25)}
    found.append(Dial("resolution", "resolution", "visits", scales))
    if bases:
        values = {str(b): base._replace(bases=b) for b in _fewer(bases)}
        found.append(Dial("bases", "FDM bases B", "terms", values))
    if frequencies:
        values = {str(f): base._replace(frequencies=f) for f in _fewer(frequencies)}
        found.append(Dial("frequencies", "frequencies F", "terms", values))
    slow = base._replace(raster=paper, compositor="definition")
    tiles = {f"{t}x{t}": slow._replace(tile=t) for t in TILES}
    found.append(Dial("tile", "tile size (definition)", "visits", tiles, lossless=True))
    found.append(
        Dial("threads", "threads", "visits", {str(t): base._replace(threads=t) for t in (1, 2)}, lossless=True)
    )
    return found


def joint(degree: int, near: float) -> dict[str, Setting]:
    """Precision x cutoff x stop, and the coarsest of them once more at half resolution."""
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


def _raster(base: Setting, field: str, values: dict[str, float]) -> dict[str, Setting]:
    return {label: base._replace(raster=base.raster._replace(**{field: value})) for label, value in values.items()}


def _supports(base: Setting, paper: RasterSettings) -> dict[str, Setting]:
    """The rules at one cutoff on the path `definition`; the first again on the fast path."""
    names = {"everywhere": "everywhere", "ellipse": "ellipse", "three_sigma_tiles": "3 sigma tiles"}
    slow = {
        label: base._replace(raster=paper._replace(support=name), compositor="definition")
        for name, label in names.items()
    }
    return slow | {"ellipse, fast path": base._replace(raster=paper)}


def _exponentials(base: Setting) -> dict[str, Setting]:
    """The library's exponential (path `definition`), then polynomials of falling degree (fast path)."""
    found = {"library": base._replace(compositor="definition"), "degree 11": base}
    return found | {f"degree {d}": base._replace(exponential=d) for d in sorted(EXPONENTIALS, reverse=True)}


def _fewer(count: int) -> list[int]:
    """count, then halves down to 1, then 0."""
    found = [count]
    while found[-1] > 0:
        found.append(found[-1] // 2)
    return found
