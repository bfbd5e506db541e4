"""docs/guides/show.md: its table of times and sizes is what the committed measurement says."""

import importlib

import pytest

made = importlib.import_module("pages.recordings.show")


def test_every_command_was_measured():
    assert set(made.PROGRAM.read()["commands"]) == set(made.COMMANDS)


def test_it_wants_one_run(capsys):
    with pytest.raises(SystemExit):
        made.PROGRAM.run(["measure"])
    assert "required: RUN" in capsys.readouterr().err
