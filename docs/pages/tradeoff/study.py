"""The whole study of one scene: the measurement of `endotsr tradeoff`, every dial alone, and the certificate.

In: a scene. Out: tradeoff.json with the keys of the command and `dials`, `omitted` and `reference.certificate`.
"""

from collections.abc import Callable
from typing import Any

from endotsr.studies.tradeoff.measure import RenderedFrame, frame, prepare
from endotsr.studies.tradeoff.scenes import StudyScene
from endotsr.studies.tradeoff.study import REPEATS, NamedSettings, exact_is_possible, reference_setting, run_study
from pages.tradeoff.certificate import certify
from pages.tradeoff.dials import OMITTED, Dial, dials

SLOW_DIALS = ("support", "exponential", "tile")  # they need the path `definition`


class WholePlan(NamedSettings):
    """Every setting once, even if several dials contain it."""

    def __init__(self, scene: StudyScene) -> None:
        super().__init__(scene)
        small = exact_is_possible(scene)
        every = dials(scene.degree, scene.bases, scene.frequencies, scene.near)
        self.dials = [self._with_names(dial) for dial in every if small or dial.name not in SLOW_DIALS]

    def _with_names(self, dial: Dial) -> dict[str, Any]:
        points = {label: self.add(f"{dial.title} {label}", setting) for label, setting in dial.values.items()}
        about = {"name": dial.name, "title": dial.title, "cost": dial.cost, "lossless": dial.lossless}
        return about | {"points": points}


def run_whole_study(
    scene: StudyScene,
    *,
    repeats: int = REPEATS,
    keep: Callable[[str, RenderedFrame], object] = lambda file, found: None,
    begin: Callable[[int], None] = lambda steps: None,
    step: Callable[[int], None] = lambda steps: None,
) -> dict[str, Any]:
    """Measure everything; arguments as for `endotsr.studies.tradeoff.study.run_study`."""
    plan, aim = WholePlan(scene), reference_setting(scene)
    certificate = certify(scene, frame(prepare(scene, aim))[0].colour, aim.raster)
    result = run_study(scene, repeats=repeats, plan=plan, keep=keep, begin=begin, step=step)
    result["reference"]["certificate"] = certificate.as_dict()
    return dict(result) | {"dials": plan.dials, "omitted": omitted(scene)}


def omitted(scene: StudyScene) -> dict[str, str]:
    """Omitted dials, with the reason."""
    if exact_is_possible(scene):
        return OMITTED
    pairs = f"{scene.gaussians.count} Gaussians on {scene.camera.width}x{scene.camera.height} pixels"
    names = "`exact`, support rule, exponential, tile size"
    return OMITTED | {names: f"the path `definition` is too slow for {pairs}; the reference is a cutoff of 1e-14"}
