"""Domination by hand; presets that are dominated without a listed reason."""

import json
from pathlib import Path

import pytest
from made_up import moving_scene
from pages.tradeoff.text import KEPT, judge_presets

from endotsr.studies.tradeoff.study import Ranked, dominates, non_dominated, run_study

RESULTS = Path(__file__).parents[3] / "docs" / "results"


def test_domination():
    point = Ranked("p", 2, (2, 2))
    assert dominates(Ranked("a", 1, (2, 2)), point)
    assert dominates(Ranked("a", 2, (2, 1)), point)
    assert not dominates(Ranked("a", 1, (2, 3)), point), "worse in one error"
    assert not dominates(Ranked("a", 2, (2, 2)), point), "its equal"


def test_front_is_what_nothing_dominates():
    points = [Ranked(f"{x}{y}", x, (y,)) for x, y in ((1, 9), (2, 9), (2, 5), (3, 6), (4, 1), (4, 0), (5, 0))]
    assert [p.name for p in non_dominated(points)] == ["19", "25", "40"]


def test_the_front_and_the_presets_have_one_meaning_of_dominated():
    """With several errors: a point stays if one of its errors is smaller, however large the others are."""
    points = [Ranked("a", 1, (2, 2)), Ranked("b", 2, (3, 1)), Ranked("c", 2, (3, 2)), Ranked("d", 1, (2, 2))]
    assert [p.name for p in non_dominated(points)] == ["a", "b"]
    assert [p.name for p in points if any(dominates(q, p) for q in points)] == ["c"]


def unexplained(result) -> list[str]:
    """Presets that are dominated and stay without a reason; verdicts are made anew from the points."""
    verdicts = judge_presets(result["points"], result["presets"])
    return [name for name, v in verdicts.items() if v["dominated_by"] and not v["reason"]]


@pytest.fixture(scope="module")
def result():
    return run_study(moving_scene(count=80, width=32), repeats=1)


def test_listed_reasons_are_needed(result):
    """A preset that nothing dominates needs no excuse."""
    verdicts = judge_presets(result["points"], result["presets"])
    assert {name for name, v in verdicts.items() if v["dominated_by"]} == set(KEPT)
    assert all(v["reason"] is None for v in verdicts.values() if not v["dominated_by"])


def test_a_worse_preset_is_found(result):
    """One more visit and a larger error than another setting of its precision."""
    points = json.loads(json.dumps(result["points"]))
    by_name = {p["name"]: p for p in points}
    paper, other = by_name["paper"], by_name["float32, cutoff 1/255, stop 1e-4"]
    paper["visits"] = other["visits"] + 1
    paper["error"] = other["error"] | {"max": other["error"]["max"] * 1.01}
    assert unexplained(result | {"points": points}) == ["paper"]


@pytest.mark.parametrize("file", sorted(RESULTS.glob("tradeoff*.json")), ids=lambda file: file.stem)
def test_committed_measurements(file):
    """Certified, no preset dominated without a reason, and on the simulated scene the law of the cutoff."""
    result = json.loads(file.read_text(encoding="utf-8"))
    if "points" not in result:
        pytest.skip("a study of training")
    assert result["reference"]["certificate"]["holds"]
    assert result["repeats"] >= 7
    assert unexplained(result) == []
    by_name = {p["name"]: p for p in result["points"]}
    for dial in result["dials"]:
        for point in (by_name[name] for name in dial["points"].values()):
            if dial["name"] == "cutoff" and result["scene"]["name"] == "simulated":
                assert point["error"]["max"] <= 5 * point["setting"]["raster"]["alpha_cutoff"]
    page = (RESULTS.parent / "tradeoff.md").read_text(encoding="utf-8")
    assert all(reason in page for reason in KEPT.values())
