"""The map of the equations: no empty cell, and everything that it points to exists."""

import re
from importlib import import_module

import pytest
from book_map import UNDIFFERENTIATED, Equation, equations, golden_cases, has_derivation, names_of_tests  # pyright: ignore[reportMissingImports]
from package_names import DEFINITION, NOTEBOOKS, ROOT, definitions, equation_pages, linkable  # pyright: ignore[reportMissingImports]

from endotsr.port.gradcheck import all_pairs
from endotsr.port.judge.about import page_of

PAPER = ["1", "1b", *"234567"]
ROWS = {row.label: row for row in equations()}


def test_every_label_of_the_specification_has_a_row():
    assert set(ROWS) | {"b5b", "b5c"} == set(equation_pages())
    assert list(ROWS)[: len(PAPER)] == PAPER


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.label)
def test_no_cell_is_empty(row: Equation):
    """An equation that has nothing to differentiate, store or show says why."""
    assert row.functions, "no function"
    if row.without is None:
        assert row.pairs, "no gradient check"
        assert row.reverses, "no reverse pass"
    else:
        assert not row.pairs, "has a pair: take it out of UNDIFFERENTIATED"
        assert row.without.reason and names_of_tests(row.without.tests), "neither check nor tests"
    assert row.golden or (row.without and row.without.golden.startswith("none: ")), "no golden case"
    assert row.notebooks or (row.without and row.without.notebook.startswith("none: ")), "no notebook"


@pytest.mark.parametrize("label", PAPER)
def test_the_paper_has_all_of_it(label):
    """The seven equations: code, golden case, notebook with a derivation; no reason counts instead."""
    row = ROWS[label]
    assert row.functions and row.golden and row.notebooks
    assert any(has_derivation(name) for name in row.notebooks)


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.label)
def test_everything_named_exists(row: Equation):
    for dotted in (*row.functions, *row.reverses):
        assert dotted in definitions(), f"{dotted} is not defined"
        module, _, name = dotted.rpartition(".")
        assert callable(getattr(import_module(module), name))
    assert all(name in golden_cases() for name in row.golden)
    assert all((NOTEBOOKS / f"{name}.py").is_file() for name in row.notebooks)
    if row.without:
        assert (ROOT / row.without.tests).is_file()


def test_the_specification_names_the_pages_without_a_definition():
    """A definition is included where it exists; the first page lists the other pages by their first equation."""
    folder = ROOT / "docs" / "specification"
    pages = [page.read_text(encoding="utf-8") for page in folder.glob("[0-9b]*_*.md")]
    label = re.compile(r"^\$\$ \((eq-\w+)\)$", re.MULTILINE)
    without = {label.findall(text)[0] for text in pages if "{literalinclude}" not in text}
    (said,) = re.findall(r"The pages of ([^.]+) have none", (folder / "index.md").read_text(encoding="utf-8"))
    assert set(re.findall(r"`(eq-\w+)`", said)) == without


def test_every_pair_stands_in_the_map():
    missing = set(all_pairs()) - {pair.name for row in ROWS.values() for pair in row.pairs}
    assert not missing, f"no page of docs/specification defines the equation of {sorted(missing)}"


def test_a_request_names_the_page_of_its_equation():
    named = {(case["equation"], case["operation"]) for cases in golden_cases().values() for case in cases}
    pages = {one: f"docs/specification/{ROWS[one[0].lower()].page}.md" for one in named if one[0]}
    assert {one: page_of(*one) for one in pages} == pages, "add it to PAGES in port/judge/about.py"


def test_every_reason_belongs_to_an_equation():
    assert set(UNDIFFERENTIATED) <= set(ROWS)


def test_a_golden_case_of_an_equation_stands_in_the_map():
    shown = {name for row in ROWS.values() for name in row.golden}
    labels = set(ROWS)
    missing = {name for name, cases in golden_cases().items() if cases[0]["equation"].lower() in labels} - shown
    assert not missing, f"golden families that the map leaves out: {sorted(missing)}"


def test_short_names_are_linked_only_where_they_are_unique():
    assert linkable()["matern_weights"] == "endotsr.method.equations.matern.matern_weights"
    short = [dotted.rpartition(".")[2] for dotted in definitions() if not dotted.startswith(DEFINITION)]
    assert all(name not in linkable() for name in short if short.count(name) > 1)
