"""The measurement of one scene: reference, joint sweep, presets, Pareto fronts.

The result is one JSON-able dictionary, `tradeoff.json`, the only input of `text` and `budget`.
"""

import math
from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple, cast

import numba
import numpy as np
from numpy.typing import NDArray

from endotsr.studies.tradeoff.measure import Prepared, RenderedFrame, Shared, errors, frame, prepare, seconds, terms
from endotsr.studies.tradeoff.results import FORMAT, DatedMeasurement, Measurement, Point, ScenePart, Seconds
from endotsr.studies.tradeoff.scenes import StudyScene
from endotsr.studies.tradeoff.settings import CLOSE, Setting, joint, presets
from endotsr.studies.tradeoff.text import LEVELS
from endotsr.training.runs.machine import dated
from endotsr.untrusted.json import Keys

REPEATS = 7
EXACT_PAIRS = 150e6  # maximum Gaussians x pixels for the exact path as reference
Cost = Literal["forward", "both", "visits"]  # seconds of a frame, seconds with the reverse, pixel-Gaussian pairs

Progress = Callable[[int], None]  # called with the number of completed steps


class NamedSettings:
    """The distinct settings of the presets and the joint sweep, with names."""

    def __init__(self, scene: StudyScene) -> None:
        self.names: dict[Setting, str] = {}
        self.presets = {n: self.add(n, s) for n, s in presets(scene.degree, scene.near).items()}
        if not exact_is_possible(scene):
            self.names.pop(presets(scene.degree, scene.near)["exact"])
            self.presets.pop("exact")
        self.joint = [self.add(label, setting) for label, setting in joint(scene.degree, scene.near).items()]

    def add(self, name: str, setting: Setting) -> str:
        """Add a setting; returns its name, which is `name` if the setting is new."""
        return self.names.setdefault(setting, name)


def exact_is_possible(scene: StudyScene) -> bool:
    """Whether the scene is small enough for the exact path."""
    return scene.gaussians.count * scene.camera.width * scene.camera.height <= EXACT_PAIRS


def reference_setting(scene: StudyScene) -> Setting:
    """The reference for errors: the exact path, or a cutoff of 1e-14 for large scenes."""
    if exact_is_possible(scene):
        return presets(scene.degree, scene.near)["exact"]
    return Setting(raster=CLOSE._replace(near=scene.near, alpha_cutoff=1e-14), degree=scene.degree)


def run_study(
    scene: StudyScene,
    *,
    repeats: int = REPEATS,
    plan: NamedSettings | None = None,
    keep: Callable[[str, RenderedFrame], object] = lambda file, found: None,
    begin: Callable[[int], None] = lambda steps: None,
    step: Progress = lambda steps: None,
) -> Measurement:
    """Measure errors and costs of every setting.

    repeats   timed frames per setting, after one warm-up frame
    plan      the settings; None = presets and joint sweep
    keep      called with image and gradients of every setting, and the `file` of its point or "reference"
    begin     called once with the number of steps; `step` is called with the number of completed ones
    returns   tradeoff.json without date and machine (`described` adds them)
    """
    plan = plan or NamedSettings(scene)
    begin(1 + len(plan.names) * (1 + repeats))
    aim = reference_setting(scene)
    shared: Shared = {}
    reference, reference_visits = frame(prepare(scene, aim, shared))
    step(1)
    keep("reference", reference)
    prepared = [prepare(scene, setting, shared) for setting in plan.names]
    points: list[Point] = []
    for number, (ready, (setting, name)) in enumerate(zip(prepared, plan.names.items())):
        found, visits = (reference, reference_visits) if setting == aim else frame(ready)
        points.append(_point(name, number, ready, found, reference, visits))
        keep(points[-1]["file"], found)
        step(1)
    for point, times in zip(points, _timed(prepared, repeats, step), strict=True):
        point["forward"], point["both"] = (_spread(column) for column in times.T)
    candidates = {*plan.joint, *plan.presets.values()}
    return {
        "format": FORMAT,
        "scene": _about(scene),
        "reference": {"setting": setting_dict(aim)},
        "lines": {"eight_bit": 0.5 / LEVELS, "sensor_noise": scene.noise},
        "points": points,
        "joint": plan.joint,
        "presets": plan.presets,
        "fronts": {
            "forward": _front(points, candidates, "forward"),
            "both": _front(points, candidates, "both"),
            "visits": _front(points, candidates, "visits"),
        },
        "repeats": repeats,
    }


def described(result: Measurement) -> DatedMeasurement:
    """The result with the date, the machine, the versions and the threads in use."""
    return cast(DatedMeasurement, dated(result) | {"threads": numba.get_num_threads()})


def _point(
    name: str, number: int, ready: Prepared, found: RenderedFrame, reference: RenderedFrame, visits: int
) -> Point:
    """A point without its times."""
    error = errors(found, reference)
    point = {
        "name": name,
        "file": f"{number:03d}",
        "setting": setting_dict(ready.setting),
        "error": {"max": error.max, "rms": error.rms, "gradients": error.gradients, "gradient": error.gradient},
        "visits": visits,
        "terms": terms(ready),
    }
    return cast(Point, point)


def setting_dict(setting: Setting) -> Keys:
    """A setting as plain data, without its kernels."""
    raster = setting.raster._asdict() | {"deviations": setting.raster.deviations._asdict()}
    return {name: value for name, value in setting._asdict().items() if name != "kernels"} | {"raster": raster}


def _timed(prepared: list[Prepared], repeats: int, step: Progress) -> NDArray[np.float64]:
    """(settings, repeats, 2) seconds: forward, forward + reverse.

    The outer loop is over repeats: a slow change of the load of the machine reaches all settings.
    """
    times = np.empty((len(prepared), repeats, 2))
    for repeat in range(repeats):
        for i, ready in enumerate(prepared):
            times[i, repeat] = seconds(ready)
            step(1)
    return times


def _spread(values: NDArray[np.float64]) -> Seconds:
    low, median, high = np.percentile(values, [25, 50, 75])
    return {"median": float(median), "low": float(low), "high": float(high)}


def cost_of(point: Point, cost: Cost) -> float:
    """Seconds (median) or visits of a point."""
    return float(point["visits"] if cost == "visits" else point[cost]["median"])


class Ranked(NamedTuple):
    """A point of a work-precision diagram."""

    name: str
    cost: float
    errors: tuple[float, ...]


def dominates(a: Ranked, b: Ranked) -> bool:
    """Whether a costs no more than b, has no larger error, and is strictly better in one of these."""
    ours, theirs = (a.cost, *a.errors), (b.cost, *b.errors)
    return all(x <= y for x, y in zip(ours, theirs, strict=True)) and ours != theirs


def non_dominated(points: Iterable[Ranked]) -> list[Ranked]:
    """The Pareto front: the points that no other dominates, cheapest first; of equal points the first alone."""
    front: list[Ranked] = []
    for point in sorted(points, key=lambda p: (p.cost, p.errors)):
        if not any(dominates(other, point) or other[1:] == point[1:] for other in front):
            front.append(point)
    return front


def _front(points: list[Point], candidates: set[str], cost: Cost) -> list[str]:
    """Names of the undominated settings among `candidates`, cheapest first."""
    ranked = [Ranked(p["name"], cost_of(p, cost), (p["error"]["max"],)) for p in points if p["name"] in candidates]
    return [p.name for p in non_dominated(ranked)]


def _about(scene: StudyScene) -> ScenePart:
    return {
        "name": scene.name,
        "about": scene.about,
        "gaussians": scene.gaussians.count,
        "width": scene.camera.width,
        "height": scene.camera.height,
        "degree": scene.degree,
        "bases": scene.bases,
        "frequencies": scene.frequencies,
        "log10_pairs": math.log10(max(1, scene.gaussians.count * scene.camera.width * scene.camera.height)),
    }
