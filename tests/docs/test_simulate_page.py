"""docs/guides/simulate.md: its table of times is what the committed measurement says, and names every scene."""

import importlib
import json

from endotsr.clips.simulator.scenes import SCENES

made = importlib.import_module("pages.recordings.simulate")


def test_every_scene_has_its_row_of_the_guide():
    assert set(json.loads(made.FILE.read_text(encoding="utf-8"))["scenes"]) == set(SCENES)
    text = made.PAGE.read_text(encoding="utf-8")
    for name in SCENES:
        assert f"| `{name}` |" in text, name
