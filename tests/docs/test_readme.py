"""The commands that `tests/readme.py` runs are those of README.md, word for word."""

from pathlib import Path

import pytest

import readme

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_the_commands_are_those_of_the_section():
    demo, tests, word = readme.commands(README)
    assert demo.startswith("python -m venv .venv && .venv/bin/pip install . && ") and demo in README
    assert tests == ".venv/bin/pip install '.[test]' && .venv/bin/pytest"
    assert word == f"{tests} -k " + "grad" + "check"


def test_a_readme_without_them_is_refused():
    with pytest.raises(ValueError, match="no two `sh` blocks"):
        readme.commands(README.replace("```sh", "```text"))


def test_a_command_that_fails_is_told(tmp_path):
    assert readme.run("exit 3", tmp_path, tmp_path / "cache").code == 3
    assert readme.run("test ! -e .venv && pwd", tmp_path, tmp_path / "cache").code == 0


def test_a_command_finds_no_cache_but_the_one_that_it_is_given(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "elsewhere")
    command = f'test "$XDG_CACHE_HOME" = {tmp_path}/cache -a -z "$NUMBA_CACHE_DIR" -a -n "$PIP_CACHE_DIR"'
    assert readme.run(command, tmp_path, tmp_path / "cache").code == 0
