"""docs/effects.md: its generated parts are what the committed results say."""

import math
import re

import pytest
from effects_parts import ANSWERED, interval
from marks import replaced

import effects
from endotsr.effects.inspect import EFFECTS
from endotsr.effects.savings import MEASURED
from endotsr.errors import InputError

MARKED = re.compile(r"<!-- effects:(\w+):start -->")


def test_committed_page_is_what_the_results_say():
    text = effects.PAGE.read_text(encoding="utf-8")
    made = effects.fragments(effects.read())
    assert sorted(MARKED.findall(text)) == sorted(made)
    assert replaced(text, made, effects.PAGE, "effects") == text


def test_every_effect_has_its_row():
    assert set(EFFECTS) - {"camera motion"} <= set(ANSWERED)  # a camera that moves is answered through its views


def test_false_positives_are_at_most_five_percent():
    measured = effects.read()
    if "detect" not in measured:
        pytest.skip("not measured yet: python docs/pages/effects.py detect 5")
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


def test_unknown_words_and_missing_results_are_refused(tmp_path):
    with pytest.raises(SystemExit, match="docs/pages/effects"):
        effects.main(["paint"])
    with pytest.raises(InputError, match="made by"):
        effects.read(tmp_path)
