"""Budgets in a person's words, and the setting that keeps each."""

import pytest
from made_up import moving_scene

from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import parse
from endotsr.cli.train import TrainOptions
from endotsr.errors import InputError
from endotsr.studies.tradeoff.budget import clamp_note, frame_advice, parse_budget, settings_words
from endotsr.studies.tradeoff.study import run_study
from endotsr.training.fitting.model import raster_settings


@pytest.mark.parametrize(
    ("text", "kind", "amount"),
    [
        ("10 ms", "frame", 0.01), ("10ms", "frame", 0.01), ("0.1 s", "frame", 0.1), ("30 FPS", "frame", 1 / 30),
        ("250 us", "frame", 250e-6), ("1/255", "error", 1 / 255), ("0.5/255", "error", 0.5 / 255),
        ("1e-3", "error", 1e-3), ("5", "error", 5), (".004", "error", 0.004),
    ],
)  # fmt: skip
def test_allowed_forms(text, kind, amount):
    found = parse_budget(text)
    assert (found.kind, found.amount) == (kind, pytest.approx(amount))


@pytest.mark.parametrize(
    "text",
    [
        "ten", "", "-1 ms", "0 ms", "1/0", "0", "10 km", "1/255 ms", "5 min 3", "nan", "1e400", "1e400 ms", "5 min",
        "1e400 fps", "1e-320 fps", "1e-400", "1/1e400", "1e400/1e400", "1e300/1e-300", "0 fps", "0/0",
    ],
)  # fmt: skip
def test_refusals_name_the_allowed_forms(text):
    with pytest.raises(InputError, match=r'"10 ms", "0.1 s", "30 fps".*"1/255", "1e-3"'):
        parse_budget(text)


@pytest.fixture(scope="module")
def result():
    """A measured scene whose times are made up: the more visits, the more time; float64 twice as much."""
    found = run_study(moving_scene(count=40, width=24), repeats=1)
    for p in found["points"]:
        t = 1e-6 * p["visits"] * (2 if p["setting"]["precision"] == "float64" else 1)
        p["forward"] = {"median": t, "low": 0.9 * t, "high": 1.1 * t}
    by_name = {p["name"]: p for p in found["points"]}
    found["fronts"]["forward"] = sorted(by_name, key=lambda n: by_name[n]["forward"]["median"])
    return found


def test_a_time_gives_the_most_accurate_setting_that_keeps_it(result):
    limit = sorted(p["forward"]["high"] for p in result["points"])[len(result["points"]) // 2]
    chosen = frame_advice(result, parse_budget(f"{limit * 1e3 * 1.0001} ms")).point
    assert chosen["forward"]["high"] <= limit * 1.0001
    better = [p for p in result["points"] if p["error"]["max"] < chosen["error"]["max"]]
    assert better and all(p["forward"]["high"] > limit for p in better)


def test_an_error_gives_the_fastest_setting_that_keeps_it(result):
    chosen = frame_advice(result, parse_budget("0.5/255")).point
    assert chosen["error"]["max"] <= 0.5 / 255
    faster = [p for p in result["points"] if p["forward"]["median"] < chosen["forward"]["median"]]
    assert faster and all(p["error"]["max"] > 0.5 / 255 for p in faster)


def test_refusal_with_the_reason(result):
    least = min(p["forward"]["high"] for p in result["points"])
    with pytest.raises(
        InputError, match=r"no measured setting renders 40 Gaussians at 24x19 .* in its upper quartile; the smallest"
    ):
        frame_advice(result, parse_budget(f"{least * 1e3 * 0.99} ms"))
    without = result | {"fronts": {"forward": [n for n in result["fronts"]["forward"] if n != "exact"]}}
    with pytest.raises(InputError, match="no measured setting reaches this error"):
        frame_advice(without, parse_budget("1e-30"))


def test_no_option_of_an_answer_is_the_default(result):
    by_name = {p["name"]: p for p in result["points"]}
    words = {name: settings_words(p["setting"]) for name, p in by_name.items()}
    assert (words["paper"], words["legacy"]) == ("--raster.preset paper", "--raster.preset legacy")
    assert words["exact"] == "--raster.preset exact --training.precision float64"
    assert "precision" not in words["float32, cutoff 1e-4, stop 1e-6"]
    assert "transmittance-stop" not in words["float64, cutoff 1/1024, stop 1e-4"]


def test_an_answer_says_that_its_options_keep_the_clamp_of_the_preset(result):
    """The swept settings have no Jacobian clamp, which no option switches off; `paper` and `exact` are as measured."""
    notes = {p["name"]: clamp_note(p["setting"]) for p in result["points"]}
    assert notes["paper"] == notes["exact"] == notes["legacy"] == ""
    assert "keep the Jacobian clamp 1.3 of paper" in notes["float32, cutoff 1e-4, stop 1e-6"]
    assert "keep the Jacobian clamp" in frame_advice(result, parse_budget("0.5/255")).lines[3]


def test_the_options_of_an_answer_ask_for_its_setting(result):
    by_name = {p["name"]: p for p in result["points"]}
    for name in ("float32, cutoff 1e-4, stop 1e-6", "float64, cutoff 1/1024, stop 1e-3", "exact", "paper"):
        setting = by_name[name]["setting"]
        words = settings_words(setting).split()
        base, _ = base_settings(words)
        config = parse(TrainOptions, words, "train", TrainOptions(settings=base)).settings
        raster = raster_settings(config)
        assert config.training.precision == setting["precision"]
        for field in ("alpha_cutoff", "transmittance_stop", "alpha_max"):
            assert getattr(raster, field) == pytest.approx(setting["raster"][field], rel=1e-3), (name, field)


def test_a_time_is_kept_by_the_upper_quartile_also_off_the_front(result):
    """The front is of medians: a setting on it whose times scatter leaves the budget to one beside it."""
    points = [dict(point) for point in result["points"]]
    for point in points:
        point["forward"] = {"low": 1.0, "median": 1.1, "high": 1.2}
    by_name = {point["name"]: point for point in points}
    scattered, steady = "float32, cutoff 1e-4, stop 1e-6", "float32, cutoff 1/255, stop 1e-3"
    by_name[scattered]["forward"] = {"low": 0.001, "median": 0.01, "high": 0.05}
    by_name[steady]["forward"] = {"low": 0.010, "median": 0.011, "high": 0.012}
    assert by_name[scattered]["error"]["max"] < by_name[steady]["error"]["max"]
    measured = result | {"points": points, "fronts": {"forward": [scattered, "exact"]}}
    assert frame_advice(measured, parse_budget("15 ms")).point["name"] == steady
    assert frame_advice(measured, parse_budget("60 ms")).point["name"] == scattered
