"""The check of the layout finds an output that is cut, at the widths at which it is, and passes one that is broken."""

import pytest
from check_layout import STATIC_STYLE, layout_problems
from page_visits import found_browser

pytestmark = pytest.mark.slow  # a browser
PIXEL = "data:image/gif;base64,R0lGODlhAQABAAAAACH5BAEKAAEALAAAAAABAAEAAAICTAEAOw=="
LINE = "worst relative error " * 20


def problems(folder, style: str, inside: str = f"<pre>{LINE}</pre>") -> set[tuple[str, int]]:
    """Kind and width of every problem of a chapter with one output."""
    if found_browser() is None:
        pytest.skip("no browser found")
    page = f"<!doctype html><style>{style}</style><article class='bd-article bd-article-container'><div class='cell'>"
    (folder / "a.html").write_text(f"{page}<div class='cell_output'>{inside}</div></div></article>", encoding="utf-8")
    return {(problem["kind"], problem["width"]) for problem in layout_problems(folder, ["a.html"])}


def test_a_cut_output_is_found_at_every_width(tmp_path):
    cut = "pre { overflow-x: auto } article { max-width: 60rem }"
    assert problems(tmp_path, cut) == {("output", width) for width in (390, 1000, 1400)}


def test_an_output_with_the_style_of_the_book_is_whole(tmp_path):
    assert problems(tmp_path, STATIC_STYLE.read_text(encoding="utf-8")) == set()


def test_a_picture_may_scroll_on_a_telephone_alone(tmp_path):
    style = "display: block; width: 1200px; height: 9px"
    picture = f"<div style='overflow-x: auto'><img alt='a' src='{PIXEL}' style='{style}'></div>"
    found = problems(tmp_path, "article { max-width: 60rem } pre { white-space: pre-wrap }", picture)
    assert found == {("picture", 1000), ("picture", 1400)}
