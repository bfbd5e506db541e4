"""Whether a measured setting dominates a preset of the rasteriser: a preset that is dominated is kept for a reason."""

from collections.abc import Sequence
from typing import Any

from endotsr.tradeoff.study import Ranked

# Dominated presets that are kept, with the reason. A test fails for a dominated preset that is missing here.
KEPT = {
    "legacy": "reproduces the released CUDA program, its three-sigma tiles and its gradients, for comparison",
}


def dominates(a: Ranked, b: Ranked) -> bool:
    """Whether a is nowhere worse than b and somewhere better."""
    ours, theirs = (a.cost, *a.errors), (b.cost, *b.errors)
    return all(x <= y for x, y in zip(ours, theirs, strict=True)) and ours != theirs


def dominated_by(point: Ranked, points: Sequence[Ranked]) -> list[str]:
    """Names of the points that dominate this one, cheapest first."""
    return [p.name for p in sorted(points, key=lambda p: (p.cost, p.errors)) if dominates(p, point)]


def judge_presets(points: Sequence[dict[str, Any]], presets: dict[str, str]) -> dict[str, dict[str, Any]]:
    """For every preset: the settings that dominate it, and the reason why it is kept.

    A preset serves rendering and training, so another setting dominates it only if it visits no more pairs and is no
    worse in the largest error, the RMS error and every gradient block. The comparison is within one precision, where a
    visit costs the same arithmetic.

    points    entries of `tradeoff.json`
    presets   name -> name of its point
    """
    by_name = {p["name"]: p for p in points}
    found = {}
    for preset, name in presets.items():
        own = by_name[name]
        precision, terms = own["setting"]["precision"], own["terms"]
        peers = [_ranked(p) for p in points if p["setting"]["precision"] == precision and p["terms"] == terms]
        better = dominated_by(_ranked(own), peers)
        found[preset] = {"dominated_by": better, "reason": KEPT.get(preset) if better else None}
    return found


def _ranked(point: dict[str, Any]) -> Ranked:
    error = point["error"]
    return Ranked(point["name"], point["visits"], (error["max"], error["rms"], *error["gradients"].values()))
