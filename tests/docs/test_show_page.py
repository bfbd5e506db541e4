"""docs/guides/show.md: its table of times and sizes is what the committed measurement says."""

import importlib
import json

import pytest

made = importlib.import_module("pages.recordings.show")


def test_every_command_was_measured():
    assert set(json.loads(made.FILE.read_text(encoding="utf-8"))["commands"]) == set(made.COMMANDS)


def test_it_wants_one_run():
    with pytest.raises(SystemExit, match="RUN"):
        made.main([])
