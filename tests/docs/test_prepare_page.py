"""docs/guides/prepare.md: its tables are what the committed results say, and every layout has its section."""

import importlib
import json
from pathlib import Path

import pytest

from endotsr.clips.sequences.layouts import layouts

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guides" / "prepare.md"
TABLES = ("any_clip", "own_pictures", "masks", "sinus", "poses", "long_clip", "one_camera")
SECTIONS = {"common": "The common format", "endonerf": "EndoNeRF", "stereomis": "StereoMIS", "tum": "TUM",
            "video": "Video", "points": "Points", "pictures": "Pictures", "colmap": "COLMAP", "hamlyn": "Hamlyn",
            "scared": "SCARED", "servct": "SERV-CT", "c3vd": "C3VD", "nerfstudio": "nerfstudio"}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_what_its_result_says(name):
    made = importlib.import_module(f"pages.recordings.{name}")
    if not made.FILE.exists():
        pytest.skip(f"not measured yet: python docs/make.py recordings.{name}")
    found = json.loads(made.FILE.read_text(encoding="utf-8"))
    assert made.table(found["rows"] if name == "long_clip" else found) in PAGE.read_text(encoding="utf-8")


def test_every_layout_has_its_section():
    text = PAGE.read_text(encoding="utf-8")
    assert {layout.name for layout in layouts()} == set(SECTIONS)
    for title in SECTIONS.values():
        assert f"\n## {title}\n" in text
