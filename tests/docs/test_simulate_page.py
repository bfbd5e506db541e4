"""docs/guides/simulate.md: its table of times is what the committed measurement says, and names every scene."""

import importlib
import json

import pytest

from endotsr.clips.simulator.scenes import SCENES

made = importlib.import_module("pages.recordings.simulate")


def test_table_is_what_the_measurement_says():
    if not made.FILE.exists():
        pytest.skip("not measured yet: python docs/make.py recordings.simulate times")
    found = json.loads(made.FILE.read_text(encoding="utf-8"))
    assert set(found["scenes"]) == set(SCENES)
    assert made.table(found) in made.PAGE.read_text(encoding="utf-8")


def test_every_scene_has_its_row_of_the_guide():
    text = made.PAGE.read_text(encoding="utf-8")
    for name in SCENES:
        assert f"| `{name}` |" in text, name
