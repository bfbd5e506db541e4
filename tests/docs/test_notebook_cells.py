"""Cells of the chapters are folded under lines that say what they hold, and aligned text becomes a table."""

import pytest

pytest.importorskip("sphinx", reason="Sphinx, which builds the book, is not installed (pip install '.[docs]')")
from docutils import nodes  # pyright: ignore[reportMissingModuleSource]
from notebook_cells import folded, with_tables  # pyright: ignore[reportMissingImports]

from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table


@pytest.mark.parametrize(
    "body, line",
    [
        ("np.testing.assert_allclose(a, b)\nassert a\n", "Checked: 2 assertions"),
        ("for a in (1, 2):\n    assert a\n", "Checked: 1 assertion"),
        ("a = 1\nb = 2\nc = 3\nassert a\n", "Code, with 1 assertion"),
        ("a = 1\n", "Set-up"),
        ("print(1)\n", None),
    ],
)
def test_a_cell_is_folded_under_a_line_that_says_what_it_holds(body, line):
    text = folded(f"# %% [markdown]\n# # A\n\n# %%\n{body}")
    assert text.endswith(body)
    assert (f'"code_prompt_show": "{line}"' in text) == (line is not None)


def test_a_tagged_cell_stays_as_it_is():
    text = '# %% tags=["transcription"]\nassert a\n'
    assert folded(text) == text


def test_the_table_of_a_gradient_check_becomes_a_table_with_all_its_words():
    with one_thread():
        text = table([check_pair(all_pairs()["masked_l1"], pair_stream("masked_l1", 0))])
    before, found, after = with_tables(f"first\n{text}\n\nlast")
    assert (before, after.strip()) == ("first", "last") and isinstance(found, nodes.table)
    shown = [[entry.astext() for entry in row.findall(nodes.entry)] for row in found.findall(nodes.row)]
    assert len(shown) == len(text.splitlines()) - 1  # without the rule
    assert sorted(" ".join(cell for row in shown for cell in row).split()) == sorted(
        word for line in (text.splitlines()[0], *text.splitlines()[2:]) for word in line.split()
    )
