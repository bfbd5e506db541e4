"""Every figure of the prose has a source: a record, the code, or a program that writes its block."""

import tomllib
from collections import Counter
from pathlib import Path

import bare_figures
import pytest
from bare_figures import bare

LEFT = tomllib.loads((Path(__file__).parent / "bare_figures.toml").read_text(encoding="utf-8"))


def test_no_figure_is_without_a_source():
    """`bare_figures.toml` counts those that are still to be given one: a count only falls."""
    found = bare_figures.bare_of(bare_figures.files())
    counts = Counter(one.file for one in found)
    more = [str(one) for one in found if counts[one.file] > LEFT.get(one.file, 0)]
    assert not more, "substitute it from a record or the code (docs/pages/book/figures.py), or leave it out"
    fewer = {name: counts[name] for name, count in LEFT.items() if counts[name] < count}
    assert not fewer, "lower these counts in bare_figures.toml"


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
