"""Every figure of the prose has a source: a record, the code, or a program that writes its block."""

import re

import bare_figures
import pytest
from bare_figures import bare
from pages.book import figures

from endotsr.errors import InputError

MARK = re.compile(r"<!--=([\w.]+)-->")


def test_no_figure_is_without_a_source():
    found = [str(one) for one in bare_figures.bare_of(bare_figures.files())]
    assert not found, "substitute it from a record or the code (docs/pages/book/figures.py), or leave it out"


def test_a_program_writes_every_block():
    """A block between marks hides no figure that was written by hand."""
    files = [*(bare_figures.ROOT / "docs" / "pages").rglob("*.py")]
    made = "".join(file.read_text(encoding="utf-8") for file in files)
    named = {file.parent.name if file.stem == "page" else file.stem for file in files}  # `Program.marks`
    rooms = {
        (name.split(":")[0], page.name)
        for page in figures.pages()
        for name in re.findall(r"<!-- ([\w:]+):start\b", page.read_text(encoding="utf-8"))
    }
    others = [found for found in rooms if found[0] not in named and not re.search(rf'["\s]{found[0]}["\s:]', made)]
    assert len(rooms) > 20 and others == []


def test_every_name_of_the_table_is_used_and_has_a_value():
    used = {name for page in figures.pages() for name in MARK.findall(page.read_text(encoding="utf-8"))}
    assert set(figures.FIGURES) == used
    assert all(figures.text(name) for name in figures.FIGURES)


def test_a_setting_that_the_code_has_not_is_refused():
    with pytest.raises(InputError, match=r"the code has no endotsr\.config:PAPER\.gone"):
        figures.value(figures.Setting("endotsr.config:PAPER.gone"))


def test_an_entry_of_a_list_is_found_by_its_values(tmp_path):
    (tmp_path / "a.json").write_text('{"rows": [{"n": 1, "p": "x", "v": 2.5}, {"n": 1, "p": "y", "v": 4}]}')
    at = lambda path: figures.value(figures.Figure("a.json", path, "{}"), tmp_path)
    assert at("rows.n=1&p=y.v") == 4 and at("rows.0.v") == 2.5
    assert at("rows.*.v") == 3.25 and at("rows.*n=1&p=x.v") == 2.5
    for path in ("rows.n=1.v", "rows.p=z.v", "rows.*p=z.v"):  # two entries, and none
        with pytest.raises(InputError, match=re.escape(f"no {path}")):
            at(path)


def test_a_formula_is_a_function_of_other_figures():
    double = figures.Formula(lambda one, other: one + other, ("flow.tissue", "flow.tissue"), "{:.2f}")
    assert figures.value(double) == 2 * figures.value(figures.FIGURES["flow.tissue"])


@pytest.mark.parametrize(
    "figure",
    ["39.83 dB", "4 %", "4%", "1.5 times as long", "ten times slower", "232 s", "five minutes", "half a minute",
     "33 to 50 %", "0.7, 0.7 and 1.4 %", "8 GB", "570 px", "0.1 to ¤"],
)  # fmt: skip
def test_a_planted_figure_is_found_with_its_line(figure):
    planted = figure.replace("¤", "0.5 dB<!--=flow.tissue-->") + " or so"
    for text in (f"# Title\n\nIt takes {planted}.\n", f"# Title\n\n**It takes {planted}.**\n"):
        (found,) = bare(text, "docs/a.md")
        assert str(found).startswith("docs/a.md:3: ") and found.figure.rstrip("asthelowr ") in figure


@pytest.mark.parametrize(
    "text",
    ["39.83 dB<!--=flow.tissue-->", "`4 dB`", "$4\\,$dB and $5$", "```\n4 dB\n```", "breathes three times in 24 frames",
     "<!-- a:b:start -->\n4 dB\n<!-- a:b:end -->", "all 100 % of it", "a 95 % interval", "at 640x512", "level 4 and 5",
     "0 times NaN is NaN"],
)  # fmt: skip
def test_a_figure_with_a_source_a_count_and_a_name_are_none(text):
    assert [*bare(f"# Title\n\n{text}\n", "docs/a.md")] == []


def test_prose_is_that_of_pages_cells_and_docstrings(tmp_path):
    folder = tmp_path / "notebooks"
    folder.mkdir()
    notebook, module = folder / "a.py", tmp_path / "a.py"
    notebook.write_text("# %% [markdown]\n# It takes 4 s.\n# %%\n# not 5 s\nx = 6  # s\n")
    module.write_text('"""It takes\n4 s."""\n\nx = "5 s"\n')
    assert [(one.line, one.figure) for one in bare(bare_figures.prose(notebook), "a")] == [(2, "4 s")]
    assert [(one.line, one.figure) for one in bare(bare_figures.prose(module), "a")] == [(2, "4 s")]
