"""docs/effects.md: its generated parts are what the committed results say."""

import math
from argparse import Namespace

import pytest
from pages.effects import page as effects
from pages.effects import parts as effects_parts
from pages.effects import study as effects_study
from pages.effects.parts import ANSWERED
from pages.store.intervals import interval, shown

from endotsr.clips.effects.inspect import EFFECTS
from endotsr.clips.effects.savings import MEASURED
from endotsr.errors import InputError


def test_every_effect_has_its_row():
    assert set(EFFECTS) - {"camera motion"} <= set(ANSWERED)  # a camera that moves is answered through its views


def test_false_positives_are_at_most_five_percent():
    measured = effects.read()
    if "detect" not in measured:
        pytest.skip("not measured yet: python docs/make.py effects detect 5")
    for name, counts in measured["detect"]["effects"].items():
        assert counts["false"] <= 0.05 * counts["negatives"], name


def test_a_part_that_is_off_has_the_memory_of_an_absent_part():
    """The committed measurement; its ratios of times are printed on the page."""
    parts = effects.read()["bench"]["parts"]
    assert set(parts) == set(MEASURED)
    for name, part in parts.items():
        assert part["memory_over_absent"] == 1.0, name


def test_expected_savings_are_those_that_were_measured():
    """The table inside the package is the measurement rounded to percent."""
    for name, part in effects.read()["bench"]["parts"].items():
        assert MEASURED[name] == pytest.approx(max(part["saved"], 0.0), abs=0.0051), name


def test_interval_of_a_mean():
    mean, half = interval([1.0, 2.0, 3.0])
    assert mean == 2.0 and half == pytest.approx(4.302653 / math.sqrt(3), rel=1e-6)
    assert math.isnan(interval([1.0])[1])
    assert shown([1.0, 2.0, 3.0], 1, "+") == "+2.0 ± 2.5" and shown([1.0], 1) == "1.0" and shown([], 1) == "-"


def test_unknown_words_and_missing_results_are_refused(tmp_path):
    with pytest.raises(SystemExit, match=r"docs/make\.py effects"):
        effects.PROGRAM.run(["paint"])
    with pytest.raises(InputError, match="made by"):
        effects.read(tmp_path)
    with pytest.raises(SystemExit, match="scene 'nowhere' is not allowed; use one of still, breathing"):
        effects.PROGRAM.run(["measure", "train", "nowhere"])


def test_a_study_goes_on_and_its_result_is_written_once(tmp_path, monkeypatch):
    """Made-up answers: stopped after three clips, started again, and written when all are there."""
    asked = []

    def answer_of(trial, frames):
        asked.append(trial.key)
        if len(asked) == 4:
            raise KeyboardInterrupt
        said = {name: bool(expected) for name, expected in trial.expected.items()}
        return {"key": trial.key, "size": trial.amplitude, "noise": 0.01, "said": said}

    monkeypatch.setattr(effects_study, "answer_of", answer_of)
    monkeypatch.setattr(effects, "RESULTS", tmp_path)
    detect = lambda: effects.measured(Namespace(what="detect", seeds=1, first=effects_study.FIRST_SEED))
    with pytest.raises(KeyboardInterrupt):
        detect()
    assert [path.name for path in tmp_path.iterdir()] == ["effects_detect.json.part"]
    detect()
    clips = [trial.key for trial in effects_study.trials([effects_study.FIRST_SEED])]
    assert asked == clips[:4] + clips[3:]
    assert [path.name for path in tmp_path.iterdir()] == ["effects_detect.json"]
    result = effects.read(tmp_path)["detect"]
    assert result["first_seed"] == effects_study.FIRST_SEED and result["clips"] == len(clips)
    text = effects.fragments({"detect": result})["detections"]
    first = effects_study.FIRST_SEED
    assert f"seeds {first} to {first}, none of which was used to set a threshold" in text


def test_five_of_five_has_a_lower_limit_of_55_percent():
    detect = {
        "clips": 5,
        "frames": 40,
        "first_seed": 200,
        "seeds": 5,
        "noise": 0.01,
        "machine": {},
        "date": "2026-01-01",
    }
    counts = {"detected": 5, "positives": 5, "false": 0, "negatives": 50}
    detect["machine"] = {"processor": "none", "cores": 1}
    assert "| smoke | 5 of 5 | 55% | 0 of 50 | 5.8% |" in effects_parts.detections(
        detect | {"effects": {"smoke": counts}}
    )


def test_the_answer_follows_the_results():
    one = {"psnr": 30.0, "seconds": 10.0, "numbers": 11, "gaussians": 100}
    half = one | {"psnr": 30.5, "seconds": 4.0}
    pairs = lambda auto: [{"everything": one, "auto": auto, "inspect_s": 1.0}] * 3
    same = effects_parts.answer({"real": ["clip"], "scenes": {"still": pairs(half), "clip": pairs(one)}})
    assert same.startswith("**On 2 clips `--effects auto`, inspection included, saves 20% of the time in the median, ")
    assert "and -10% to 50% by clip." in same and "saves 50% of the time" in same and "+0.50 ± 0.00 dB" in same
    assert "`clip`, there is nothing to save with `demo`, and the inspection costs 10% of the time." in same
    other = effects_parts.answer({"real": ["clip"], "scenes": {"still": pairs(half), "clip": pairs(half)}})
    assert "nothing to save" not in other and "it saves 50% of the time (+0.50 dB)" in other


def test_the_answer_says_why_the_plan_for_paper_saves_more():
    one = {"psnr": 30.0, "seconds": 10.0, "numbers": 11, "gaussians": 100}
    pair = {"everything": one, "auto": one, "inspect_s": 0.0}
    result = {"real": ["clip"], "scenes": dict.fromkeys(("still", "clip"), [pair] * 3)}
    plan = {"changes": [{"key": "model.spectral_motion"}], "time_saved": 0.04, "memory_saved": 0.072}
    bench = {"parts": {"spectral_motion": {"saved": 0.0246, "memory_saved": 0.072}}}
    said = effects_parts.answer(result, {"clips": {"clip": {"plan": plan}}}, bench)
    assert "nothing to save with `demo`" in said and "saves 2% of the time" in said and "7% of the memory" in said
    assert "paper" not in effects_parts.answer(result, {"clips": {"clip": {"plan": plan | {"changes": []}}}}, bench)


def test_the_saving_of_the_answer_is_that_of_the_table():
    found = effects.read()
    row = next(line for line in effects_parts.costs(found["bench"]).splitlines() if "model.spectral_motion" in line)
    time, memory = (cell.strip() for cell in row.split("|")[4:6])
    made = effects.fragments(found)["answer"]
    assert f"saves {time} of the time of an iteration and {memory} of the memory" in made
