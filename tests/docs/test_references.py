"""Each chapter ends with the subjects of the literature that docs/references.md names for it."""

from pathlib import Path

import pytest

pytest.importorskip("sphinx")

from book_links import literature, notebook

ROOT = Path(__file__).parents[2]
OWN = {3, 21}  # chapters that rest on no work of others
TEXT = "**One thing** (chapters 2 to 4, 7).\n**Another** (chapter 3). More.\n**All** (every chapter).\n"


@pytest.mark.parametrize(
    ("chapter", "expected"),
    [(1, []), (2, ["One thing"]), (3, ["One thing", "Another"]), (4, ["One thing"]), (5, []), (7, ["One thing"])],
)
def test_a_subject_belongs_to_the_chapters_in_its_brackets(chapter, expected):
    assert literature(TEXT, chapter) == expected


def test_every_chapter_has_literature():
    references = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
    for file in sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.py")):
        chapter = int(file.name[:2])
        assert bool(literature(references, chapter)) == (chapter not in OWN), file.name
        text = file.read_text(encoding="utf-8")
        last = notebook(file.stem, text).split("# %% [markdown]")[-1]
        assert ("**Literature** on " in last and "{doc}`/references`" in last) == (chapter not in OWN)
