"""The libraries in the wheel of PyAV are those that the guide names."""

from pathlib import Path

from bundled import bundled, under_gpl

GUIDE = Path(__file__).parents[1] / "docs" / "guides" / "platforms.md"


def test_the_guide_names_every_library_under_the_gpl():
    said = GUIDE.read_text(encoding="utf-8")
    for name in under_gpl(bundled()):
        assert name.split("-")[0].split(".")[0] in said, name


def test_licences_are_told_from_names():
    assert under_gpl(["libvpx-1.so", "libx264-d6.so.165", "x265.dll"]) == ["libx264-d6.so.165", "x265.dll"]
