"""Every room of the package has its place on the page of the API, before the book is built."""

import re

import pytest

pytest.importorskip("sphinx", reason="Sphinx, which builds the book, is not installed (pip install '.[docs]')")
import api_pages  # pyright: ignore[reportMissingImports]
from sphinx.errors import ExtensionError

from house import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(file for folder in (DOCS, DOCS / "guides", DOCS / "specification") for file in folder.glob("*.md"))
ROLE = re.compile(r"\{py:(?:class|func|mod|data)\}`~?(endotsr[\w.]*)`")


def test_every_room_is_in_one_group():
    assert api_pages.index_page().count("- {doc}`") == len(api_pages.rooms())


def test_a_room_without_a_group_stops_the_build(monkeypatch):
    monkeypatch.setattr(api_pages, "GROUPS", api_pages.GROUPS[:-1])
    with pytest.raises(ExtensionError, match=r"rooms without one group.*'cli'"):
        api_pages.index_page()


@pytest.mark.parametrize("file", PAGES, ids=lambda file: file.stem)
def test_names_of_the_package_in_a_page_are_defined_where_the_page_says(file):
    public = {*api_pages.definitions()}
    named = {*ROLE.findall(file.read_text(encoding="utf-8"))} - {*api_pages.modules()}
    assert {name for name in named if name not in public and name.rpartition(".")[0] not in public} == set()


def test_an_alias_of_a_builtin_has_its_source_where_it_is_documented():
    records = "endotsr.results.evaluation.records"
    assert api_pages.module_of_source(None, records, "MeasureRow") == records
    assert api_pages.module_of_source(None, "endotsr", "Run") is None, "the module that defines the class"
