"""The sets of versions that `python tests/versions.py` installs follow pyproject.toml."""

import pytest

import versions


def test_the_lowest_set_names_every_dependency():
    pins = versions.constraints("lowest")
    assert len(pins) == len(versions.dependencies()) and all(pin.endswith(".*") and "==" in pin for pin in pins)
    assert any(pin.startswith("numpy==") for pin in pins)
    assert versions.constraints("newest") == [] and versions.constraints("opencv4") == [f"{versions.OPENCV}<5"]


def test_a_dependency_without_a_lower_bound_is_refused(monkeypatch):
    monkeypatch.setattr(versions, "dependencies", lambda: ["numpy"])
    with pytest.raises(ValueError, match="no lower bound"):
        versions.constraints("lowest")


def test_every_test_of_the_list_exists():
    assert [name for name in versions.TESTS if not (versions.ROOT / name).is_file()] == []
