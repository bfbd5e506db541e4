"""The layout of docstrings: rows, notes, formulas and links, without loss of a word."""

import pytest

pytest.importorskip("sphinx", reason="Sphinx, which builds the book, is not installed (pip install '.[docs]')")
from docstring_layout import INLINE, NOTE, blocks, grouped  # pyright: ignore[reportMissingImports]

from endotsr.method.equations.matern import matern_weights
from endotsr.results.evaluation.metrics import psnr

TEXT = """Summary of it, first line
and second.

omega    (F,)  cycles, > 0
returns  (F,)  weights,
         mean 1
Reverse: none.
Edges:   zero is fine; `other_name` too,
         and so on.

    G_j = reduce(G_{j-1})
"""


def kinds(docstring: str) -> list[list[tuple[str, int]]]:
    return [[(kind, len(entries)) for kind, entries in grouped(block)] for block in blocks(docstring.splitlines())]


def test_a_block_is_split_into_text_rows_and_notes():
    text, table, formula = blocks(TEXT.splitlines())
    assert kinds("\n".join(text)) == [[("text", 1)]]
    assert [(kind, len(entries)) for kind, entries in grouped(table)] == [("row", 2), ("note", 2)]
    rows = next(iter(grouped(table)))[1]
    assert rows[1] == ["returns  (F,)  weights,", "         mean 1"]
    assert formula == ["    G_j = reduce(G_{j-1})"]


def test_no_line_is_lost():
    for docstring in (TEXT, str(matern_weights.__doc__), str(psnr.__doc__)):
        lines = [line.rstrip() for line in docstring.splitlines() if line.strip()]
        shown = [line for b in blocks(docstring.splitlines()) for _, es in grouped(b) for e in es for line in e]
        assert shown == lines


def test_notes_are_told_from_sentences():
    assert NOTE.match("Edges:   N = 0 gives 0.")
    assert not NOTE.match("Rules. A Gaussian: is pruned")


@pytest.mark.parametrize(
    "text, found",
    [
        ("Equation (4), upper line", [("paper", "4")]),
        ("equation (1b) and (B5)", [("paper", "1b"), ("alone", "B5")]),
        ("specification B2-B5", [("base", "B2"), ("base", "B5")]),
        ("shape (3) of `matern_weights`", [("code", "matern_weights")]),
        ("see matern_weights, below", [("bare", "matern_weights")]),
        ("48 pixels (3, 2F, N)", []),
    ],
)
def test_links_in_a_line(text, found):
    matches = [next((k, v) for k, v in m.groupdict().items() if v) for m in INLINE.finditer(text)]
    assert matches == found
