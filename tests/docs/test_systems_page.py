"""The page on systems holds the table of the stored result, which is as expected, and names what exists."""

import re

import pytest
from packaging.requirements import Requirement
from pages.book import systems
from pages.store.program import DOCS

import platforms

ROWS = systems.PROGRAM.read()["rows"]


def test_every_system_is_resolved_as_expected():
    pairs = [(row["system"], row["python"]) for row in ROWS]
    assert pairs == [(system.name, python) for system in platforms.SYSTEMS for python in platforms.PYTHONS]
    assert platforms.surprises(ROWS) == []


def test_a_row_that_is_not_as_expected_is_seen():
    row = next(row for row in ROWS if row["system"] == "Windows x86-64")
    assert platforms.surprises([row | {"complete": False, "lacks": "scipy"}]) == [
        f"Windows x86-64, Python {row['python']}: scipy has no wheel"
    ]


@pytest.mark.parametrize("system, machine", [("darwin", "x86_64"), ("darwin", "arm64"), ("win32", "AMD64")])
def test_every_system_asks_for_each_dependency_once(system, machine):
    asked = [Requirement(line) for line in platforms.dependencies()]
    there = {"sys_platform": system, "platform_machine": machine}
    names = [r.name for r in asked if r.marker is None or r.marker.evaluate(there)]
    assert len(set(names)) == len(names) and {"numba", "filelock", "psutil"} <= set(names)


def test_every_file_that_the_page_names_exists():
    (page,) = systems.PROGRAM.pages
    text = page.read_text(encoding="utf-8")
    for path in re.findall(r"((?:tests|docs)/\S+?\.py)", text):
        assert (DOCS.parent / path).is_file(), path
