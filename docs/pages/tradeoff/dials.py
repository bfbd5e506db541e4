"""The dials between exact and fast: their measured values, and omissions with their reasons.

Each dial is varied alone, with accurate values for everything else. `endotsr.studies.tradeoff.settings` has the joint
sweep of the three most important ones.
"""

from typing import NamedTuple

from endotsr.method.splatting.settings import RasterSettings
from endotsr.studies.tradeoff.settings import ACCURATE, CLOSE, CUTOFFS, STOPS, Setting
from pages.tradeoff.kernels import Variant


class Dial(NamedTuple):
    """One setting varied, the others fixed."""

    name: str
    title: str
    cost: str  # machine-independent cost: `visits` or `terms`
    values: dict[str, Setting]  # by label, from accurate to fast
    lossless: bool = False  # must not change a bit of the image


CLAMPS = {"none": CLOSE.alpha_max, "0.999": 0.999, "0.99": 0.99, "0.95": 0.95}
EXPONENTIALS = (3, 5, 7)  # degrees besides the built-in 11
TILES = (8, 16, 32)

OMITTED = {
    "low-pass of 0.3 px^2, near plane": "they change the model, not the arithmetic, so there is no error",
    "off-axis clamp of the Jacobian": "part of the presets; with a centred principal point it acts on Gaussians "
    "whose centre is outside the picture, and changes the pixels that they reach",
    "culling": "exact in every setting: a Gaussian that reaches no pixel is never visited",
    "reuse of the depth order between frames": "not offered: the order is exact in every frame",
    "T stored or replayed in the reverse pass": "fixed by the compositor: `definition` keeps T, `blocks` replays it",
    "tile size of the fast path": "64x16 pixels, a constant of the compiled vector code; "
    "the dial varies the tiles of `definition`",
    "fast-math": "not offered: sums keep their order, so that results are reproducible bit for bit",
}


def dials(degree: int, bases: int, frequencies: int, near: float) -> list[Dial]:
    """All dials that apply to a scene, each varied from `ACCURATE`.

    degree, bases, frequencies   of the trained scene; 0 bases or frequencies: no such component
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
    tiles = {f"{t}x{t}": slow._replace(kernels=Variant(tile=t)) for t in TILES}
    found.append(Dial("tile", "tile size (definition)", "visits", tiles, lossless=True))
    found.append(
        Dial("threads", "threads", "visits", {str(t): base._replace(threads=t) for t in (1, 2)}, lossless=True)
    )
    return found


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
    return found | {
        f"degree {d}": base._replace(kernels=Variant(exponential=d)) for d in sorted(EXPONENTIALS, reverse=True)
    }


def _fewer(count: int) -> list[int]:
    """count, then halves down to 1, then 0."""
    found = [count]
    while found[-1] > 0:
        found.append(found[-1] // 2)
    return found
