"""Every generated part of a page is what its program writes from the committed records."""

import argparse
import json
import re
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location

import pytest
from pages.store import program
from pages.store.marks import replaced

SPEC = spec_from_file_location("docs_make", program.DOCS / "make.py")
make = module_from_spec(SPEC)  # `make` alone is that of golden
SPEC.loader.exec_module(make)


def program_of(name):
    """The declaration of a program of `docs/make.py`."""
    room, _, stem = name.partition(".")
    return getattr(import_module(f"pages.{room}.{stem or 'page'}"), "PROGRAM", None)


PROGRAMS = {name: found for name in make.programs() if (found := program_of(name))}
PAGES = [(name, page) for name, found in PROGRAMS.items() for page in found.pages]


@pytest.mark.parametrize("name, page", PAGES, ids=[f"{name}-{page.name}" for name, page in PAGES])
def test_a_page_is_what_its_program_writes(name, page):
    about, text = PROGRAMS[name], page.read_text(encoding="utf-8")
    assert f"<!-- {about.marks}:" in text
    assert replaced(text, about.made(), page, about.marks) == text, f"run: python docs/make.py {name}"


MARK = re.compile(r"<!-- (\w+:\w+):start -->")
SURVEY = "programs:tables"  # written by `tests/port/programs/survey.py`
FOLDERS = ("", "docs", "docs/guides", "docs/specification", "docs/results", "notebooks", "golden")
MARKS = sorted({mark for folder in FOLDERS
                for page in (program.DOCS.parent / folder).glob("*.md")
                for mark in MARK.findall(page.read_text(encoding="utf-8"))} - {SURVEY})  # fmt: skip


@pytest.mark.parametrize("mark", MARKS)
def test_the_program_of_a_mark_is_named(mark, capsys):
    """One program, unless its parts are named as they are made; a program with a declaration writes to this room."""
    named = make.writers(mark)
    assert named and {PROGRAMS[name].marks for name in named if name in PROGRAMS} <= {mark.partition(":")[0]}
    assert make.main([mark]) == 0
    assert capsys.readouterr().out.splitlines() == [f"python docs/make.py {name}" for name in named]


def test_the_program_of_the_table_of_whole_commands(capsys):
    assert make.writers("presets:whole") == ["book.presets"]
    assert make.main(["no_such_room:table"]) == 2 and "no_such_room:table" in capsys.readouterr().err


def test_every_part_stands_on_a_page():
    for name, about in PROGRAMS.items():
        texts = "".join(page.read_text(encoding="utf-8") for page in about.pages)
        parts = about.made() if about.pages else {}
        assert [part for part in parts if f"<!-- {about.marks}:{part}:start -->" not in texts] == [], name


def test_a_program_is_found_by_its_name():
    assert all(found.name == name for name, found in PROGRAMS.items())
    assert "full_size" in PROGRAMS and "recordings.any_clip" in PROGRAMS and "book.preview" in make.programs()


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A program with a record and a page in a folder of its own."""
    monkeypatch.setattr(program, "DOCS", tmp_path)
    monkeypatch.setattr(program, "RESULTS", tmp_path)
    (tmp_path / "page.md").write_text("<!-- test_generated_pages:sum:start -->\n<!-- test_generated_pages:sum:end -->")
    options = {"--first": 1, "--second": {"type": int, "default": 2}}
    measure = lambda options: {"sum": options.first + options.second}
    return program.Program(__name__, "page.md", {"sum": lambda found: str(found["sum"])}, "r.json", measure, options)


def test_a_measurement_writes_record_and_page(small, tmp_path):
    with pytest.raises(SystemExit, match=r"error: .*r\.json: cannot be read.*make\.py .*test_generated_pages measure"):
        small.run([])
    small.run(["measure", "--first", "4"])
    assert json.loads(small.file.read_text())["sum"] == 6 and "date" in json.loads(small.file.read_text())
    assert "start -->\n6\n<!--" in (tmp_path / "page.md").read_text()
    small.file.write_text('{"sum": 9}')
    small.run([])
    assert "start -->\n9\n<!--" in (tmp_path / "page.md").read_text()


def test_a_measurement_into_another_file_leaves_record_and_page(small, tmp_path, capsys):
    page = (tmp_path / "page.md").read_text()
    small.run(["measure", "--record", str(tmp_path / "other.json")])
    assert capsys.readouterr().out == "3\n" and not small.file.exists() and (tmp_path / "page.md").read_text() == page


def test_unknown_words_show_the_usage(small, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "__doc__", "what it does")
    with pytest.raises(SystemExit, match="what it does"):
        small.run(["table"])


def test_the_options_of_every_program_are_complete():
    for found in PROGRAMS.values():
        assert isinstance(found._parser(""), argparse.ArgumentParser)
