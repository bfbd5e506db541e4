"""`docs/make.py bench measure scaling`: growth of cost with each size alone, with fitted exponents.

Every point is measured in a separate process, so its peak memory belongs to its size. It is measured twice, with sizes
ascending and descending, and the faster time is used: a temporary load of the machine does not distort the curve. An
exponent is the least-squares slope of log time against log size over the upper decade, because fixed costs flatten the
curve below it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from endotsr.studies.bench.case import BenchCase, apart, measure
from endotsr.studies.bench.clock import REST, SPLAT, STAGES
from endotsr.studies.bench.stages import Say, line

# Stages that grow together, in the order of the legend.
CURVES: dict[str, tuple[str, ...]] = {
    "iteration": (*STAGES, REST),
    "splat": SPLAT,
    "blending": ("blend forward", "blend reverse"),
    "binning": ("binning",),
    "time bases": ("FDM",),
    "Fourier": ("Fourier",),
    "losses": ("L1 and SSIM", "pyramid", "depth and smoothness"),
}
BASE = BenchCase(gaussians=20_000, repeats=7, densifications=0)
LARGE = 100_000  # from this number of Gaussians on, iterations are long and fewer repeats suffice


class Axis(NamedTuple):
    """One varied size."""

    unit: str
    cases: tuple[BenchCase, ...]
    curves: tuple[str, ...]  # curves that depend on this size, or should not
    along: Callable[[dict[str, Any]], float]  # the size of a measured case


def axes(largest: int) -> dict[str, Axis]:
    """Every axis; `largest` is the largest number of Gaussians."""
    counts = [n for n in (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000) if n <= largest]
    sizes = ((192, 108), (384, 216), (640, 360), (960, 540), (1440, 810), (1920, 1080))
    of_case = lambda name: lambda result: float(result["case"][name])
    vary = lambda name, values: tuple(replace(BASE, **{name: value}) for value in values)
    return {
        "gaussians": Axis(
            "Gaussians",
            tuple(replace(BASE, gaussians=n, repeats=3 if n >= LARGE else BASE.repeats) for n in counts),
            ("iteration", "splat", "blending", "binning", "time bases", "Fourier"),
            of_case("gaussians"),
        ),
        "pairs": Axis(
            "blended pairs",
            tuple(replace(BASE, gaussians=60_000, size=size) for size in (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)),
            ("splat", "blending", "binning"),
            lambda result: float(result["view"]["blended"]),
        ),
        "pixels": Axis(
            "pixels",
            tuple(replace(BASE, width=width, height=height) for width, height in sizes),
            ("iteration", "blending", "losses"),
            lambda result: float(result["case"]["width"] * result["case"]["height"]),
        ),
        "bases": Axis("time bases B", vary("bases", (4, 8, 17, 34)), ("iteration", "time bases"), of_case("bases")),
        "frequencies": Axis(
            "frequencies F", vary("frequencies", (4, 8, 16, 32)), ("iteration", "Fourier"), of_case("frequencies")
        ),
        "frames": Axis("frames", vary("frames", (8, 16, 32, 64)), ("iteration",), of_case("frames")),
    }


def measure_scaling(largest: int, names: Sequence[str], say: Say) -> dict[str, Any]:
    """{"axes": {name: of `summary`}, "memory": of `memory`} for the named axes."""
    chosen = {name: axis for name, axis in axes(largest).items() if name in names}
    found = {}
    for name, axis in chosen.items():
        results: list[dict[str, Any]] = []
        for case in (*axis.cases, *reversed(axis.cases)):
            timed = apart(measure, case)
            results.append(timed)
            say(f"{name}: {line(timed)}")
        found[name] = summary(axis, faster(results))
    return {"axes": found, "memory": memory(found)}


def faster(results: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The faster of the two results of every size, from results with ascending and then descending sizes."""
    there, back = results[: len(results) // 2], results[: len(results) // 2 - 1 : -1]
    return [min(pair, key=lambda result: _total(result, CURVES["iteration"])) for pair in zip(there, back)]


def summary(axis: Axis, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Sizes, times of each curve, their exponents and the peak memory along one axis."""
    size = [axis.along(result) for result in results]
    curves = {name: [_total(result, CURVES[name]) for result in results] for name in axis.curves}
    return {
        "unit": axis.unit,
        "size": size,
        "median_ms": curves,
        "exponent": {name: exponent(size, times) for name, times in curves.items()},
        "peak_memory_bytes": [result["peak_memory_bytes"] for result in results],
        "state_bytes": [_state_bytes(result) for result in results],
    }


def _total(result: dict[str, Any], stages: tuple[str, ...]) -> float:
    return sum(result["stages"][name]["median_ms"] for name in stages)


def _state_bytes(result: dict[str, Any]) -> int:
    """Parameters and their two moments."""
    case = result["case"]
    return 3 * result["parameters"] * case["gaussians"] * (8 if case["precision"] == "float64" else 4)


def upper_decade(size: Sequence[float]) -> np.ndarray:
    """Which sizes are at least 10 % of the largest."""
    return np.array(size) >= max(size) / 10.0


def exponent(size: Sequence[float], times: Sequence[float]) -> float | None:
    """p of times ~ size^p over the upper decade; None with fewer than two sizes or a time that is not positive."""
    chosen = upper_decade(size)
    x, y = np.array(size)[chosen], np.array(times)[chosen]
    if len(set(x)) < 2 or not (y > 0).all():
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def memory(found: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Bytes per Gaussian and per frame: slopes of the peak memory over the upper decade; None if not known."""
    return {f"bytes_per_{name[:-1]}": _slope(found.get(name)) for name in ("gaussians", "frames")}


def _slope(axis: dict[str, Any] | None) -> float | None:
    if axis is None or None in axis["peak_memory_bytes"] or len(set(axis["size"])) < 2:
        return None
    chosen = upper_decade(axis["size"])
    return float(np.polyfit(np.array(axis["size"])[chosen], np.array(axis["peak_memory_bytes"])[chosen], 1)[0])
