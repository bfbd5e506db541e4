"""Every chapter has a motive, a derivation, figures and exercises, and the table in notebooks/index.md says so."""

import re
from argparse import Namespace

import pytest
from pages.book import chapters

from endotsr.errors import InputError

TEXTS = {file.stem: file.read_text(encoding="utf-8") for file in sorted(chapters.NOTEBOOKS.glob("*.py"))}
CUTS = {
    "derivation": ("\n# ## The reverse pass", "\n# ## Another section"),
    "figure": ("plt.show()", "pass"),
    "exercises": ("\n# 3. ", "\n# "),
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_chapter_lacks_nothing(name):
    assert chapters.missing(name, chapters.chapter_of(TEXTS[name])) == []


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("element", ["derivation", "figure", "exercises"])
def test_an_element_that_is_taken_out_is_missing(name, element):
    if element == "derivation" and name in chapters.MEASURES:
        pytest.skip("measures what others derive")
    text = TEXTS[name].replace(*CUTS[element])
    if element == "derivation":
        text = re.sub(r"\*\*\(\d+\.\d+\)", "", text)
    assert chapters.missing(name, chapters.chapter_of(text)) == [element]


def test_a_chapter_that_begins_with_an_equation_has_no_motive():
    head, _, tail = TEXTS["06_covariance"].partition("\n# # ")
    title, _, rest = tail.partition("\n#\n# ")
    chapter = chapters.chapter_of(f"{head}\n# # {title}\n#\n# ## The equation\n# {rest}")
    assert chapters.missing("06_covariance", chapter) == ["motive"]


def test_every_chapter_was_timed_and_the_book_takes_ten_minutes_at_most():
    times = chapters.PROGRAM.read()["chapters"]
    assert set(times) == set(TEXTS)
    assert all(row["processor_seconds"] > 0 for row in times.values())
    assert sum(row["processor_seconds"] for row in times.values()) <= chapters.LONGEST


def test_some_chapters_are_timed_and_the_others_keep_their_times(monkeypatch, tmp_path):
    (tmp_path / "01_a.py").write_text("", encoding="utf-8")
    (tmp_path / "02_b.py").write_text("", encoding="utf-8")
    monkeypatch.setattr(chapters, "NOTEBOOKS", tmp_path)
    stored = chapters.PROGRAM.read()["chapters"]
    measured = lambda *numbers: chapters.measured(Namespace(numbers=[*numbers], record=chapters.PROGRAM.file))
    found = measured("02")["chapters"]
    assert found == stored | {"02_b": found["02_b"]} and "01_a" not in found
    assert set(measured()["chapters"]) == {"01_a", "02_b"}
    with pytest.raises(InputError, match=r"no notebook .*03.*; use 01 or 02"):
        measured("03")
