"""docs/guides/simulate.md: its table of times is what the committed measurement says, and names every scene."""

import importlib

from endotsr.clips.simulator.scenes import SCENES

made = importlib.import_module("pages.recordings.simulate")


def test_every_scene_has_its_row_of_the_guide():
    assert set(made.PROGRAM.read()["scenes"]) == set(SCENES)
    text = made.PROGRAM.pages[0].read_text(encoding="utf-8")
    for name in SCENES:
        assert f"| `{name}` |" in text, name
