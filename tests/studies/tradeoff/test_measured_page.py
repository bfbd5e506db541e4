"""The page of a measurement: answers, diagram and table come from its figures."""

import copy
import json
import re
from pathlib import Path

import pytest

from endotsr.studies.tradeoff.budget import settings_words
from endotsr.studies.tradeoff.page import compared_with_paper, tradeoff_page
from endotsr.studies.tradeoff.text import levels, made, milliseconds

RESULT = json.loads((Path(__file__).parents[3] / "docs" / "results" / "tradeoff.json").read_text(encoding="utf-8"))
POINTS = {point["name"]: point for point in RESULT["points"]}


def test_the_sentence_names_the_cheapest_setting_within_a_level():
    said = compared_with_paper(RESULT)
    chosen = POINTS[said.split(" is off")[1].partition(". The setting ")[2]]
    others = [p for p in RESULT["points"] if p["error"]["max"] <= 1 / 255 and p["name"] in RESULT["fronts"]["visits"]]
    assert chosen in others and chosen["visits"] == min(p["visits"] for p in others)
    paper = POINTS[RESULT["presets"]["paper"]]
    assert f"{chosen['visits'] / paper['visits']:.1f} times its visits" in said


def test_without_a_setting_within_a_level_the_sentence_says_so():
    coarse = copy.deepcopy(RESULT)
    for point in coarse["points"]:
        point["error"]["max"] = 0.5
    assert compared_with_paper(coarse).endswith("No measured setting is within one level of 8 bits.")


def test_the_page_holds_the_front_the_answers_and_the_diagram():
    page = tradeoff_page(RESULT)
    assert all(name in page for name in RESULT["fronts"]["forward"])
    assert "data:image/svg+xml;base64," in page and "--raster.alpha-cutoff" in page and "<script" not in page


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(3.642, "3640 ms"), (0.9996, "1000 ms"), (0.04, "40 ms"), (0.0111, "11.1 ms"), (61, "61000 ms")],
)
def test_a_time_is_written_without_a_power_of_ten(seconds, said):
    assert milliseconds(seconds) == said


@pytest.mark.parametrize(
    ("error", "said"), [(1.0, "255/255"), (0.45, "115/255"), (45 / 255, "45/255"), (0.2 / 255, "0.2/255"), (0, "0/255")]
)
def test_a_large_error_is_written_in_whole_levels(error, said):
    assert levels(error) == said


def test_the_measurement_is_said_of_one_thread_as_of_two():
    assert "on 1 thread of" in made(RESULT | {"threads": 1}) and "on 2 threads of" in made(RESULT | {"threads": 2})


def test_an_option_and_its_value_stay_on_one_line():
    """At the width of a phone, `--raster.alpha-max` was broken after its hyphens."""
    assert re.search(r'<code><span class="whole">--raster\.alpha-cutoff \S+</span> <span', tradeoff_page(RESULT))


def test_an_answer_on_the_page_says_what_its_options_keep():
    assert "</code> (they keep the Jacobian clamp 1.3 of paper" in tradeoff_page(RESULT)


def test_the_options_of_legacy_name_the_preset():
    """Its support and its gradients have no options of their own."""
    assert settings_words(POINTS["legacy"]["setting"]) == "--raster.preset legacy"


def test_a_budget_that_nothing_keeps_has_its_reason_and_names_are_escaped():
    slow = copy.deepcopy(RESULT)
    for point in slow["points"]:
        point["forward"] |= {"median": 9.0, "high": 9.0}
    slow["scene"]["name"] = "<b>scene"
    page = tradeoff_page(slow)
    assert "no measured setting renders" in page and "<b>scene" not in page and "--budget" not in page
