"""docs/guides/show.md: its table of times and sizes is what the committed measurement says."""

import importlib
import json

import pytest

made = importlib.import_module("pages.recordings.show")


def test_table_is_what_the_measurement_says():
    if not made.FILE.exists():
        pytest.skip("not measured yet: python docs/make.py recordings.show RUN")
    found = json.loads(made.FILE.read_text(encoding="utf-8"))
    assert set(found["commands"]) == set(made.COMMANDS)
    assert made.table(found) in made.PAGE.read_text(encoding="utf-8")


def test_it_wants_one_run():
    with pytest.raises(SystemExit, match="RUN"):
        made.main([])
