"""docs/guides/simulate.md: its table of times is what the committed measurement says, of every scene."""

import importlib

from endotsr.clips.simulator.scenes import SCENES

made = importlib.import_module("pages.recordings.simulate")


def test_what_the_scenes_have_in_common():
    """As the guide says below its table."""
    assert all("noise" in effects for effects in SCENES.values())
    assert [name for name, effects in SCENES.items() if "highlights" not in effects] == ["still"]


def test_every_scene_is_described_and_was_measured():
    """A row in either table; before, a scene that was measured counted as described."""
    assert set(made.PROGRAM.read()["scenes"]) == set(SCENES)
    text = made.PROGRAM.pages[0].read_text(encoding="utf-8")
    assert {name: text.count(f"| `{name}` |") for name in SCENES} == dict.fromkeys(SCENES, 2)
