"""Pictures whose words can be read, and sentences with the figures of the measurement."""

import json
from pathlib import Path

import pytest
from made_up import moving_scene
from pages.tradeoff.figures import draw
from pages.tradeoff.study import run_whole_study
from pages.tradeoff.text import advice, dial_rows, error_over_cutoff

from endotsr.studies.tradeoff.figure import main_figure
from endotsr.studies.tradeoff.settings import CUTOFFS
from endotsr.studies.tradeoff.study import described

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
COMMITTED = sorted((ROOT / "docs" / "results").glob("tradeoff*.json"))


@pytest.fixture(scope="module")
def result():
    return described(run_whole_study(moving_scene(count=24, width=24), repeats=1))


def overlaps(figure) -> list[tuple[str, str]]:
    """Pairs of words in one panel that cover each other."""
    from matplotlib.text import Text

    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    found = []
    for axes in figure.axes:
        boxes = [(t.get_text(), Text.get_window_extent(t, renderer)) for t in axes.texts]
        found += [(a, b) for i, (a, one) in enumerate(boxes) for b, other in boxes[:i] if one.overlaps(other)]
    return found


def test_no_word_covers_another(result):
    figure = main_figure(result)
    assert sum(len(axes.texts) for axes in figure.axes) > 10
    assert overlaps(figure) == []


@pytest.mark.parametrize("file", COMMITTED, ids=lambda file: file.stem)
def test_no_word_covers_another_in_the_committed_pictures(file):
    committed = json.loads(file.read_text(encoding="utf-8"))
    if "points" in committed and committed["joint"]:
        assert overlaps(main_figure(committed)) == []


def test_every_value_of_every_dial_has_a_row(result):
    """With the figures of its own point."""
    rows, points = dial_rows(result), {p["name"]: p for p in result["points"]}
    assert [row[:2] for row in rows] == [[d["title"], label] for d in result["dials"] for label in d["points"]]
    names = [(d, name) for d in result["dials"] for name in d["points"].values()]
    for row, (dial, name) in zip(rows, names, strict=True):
        assert row[4].replace(" ", "") == f"{points[name][dial['cost']]}{dial['cost']}"
        assert row[5] == f"{points[name]['error']['max'] * 255:.2g}/255"


def test_equal_results_give_equal_pictures(result, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        assert draw(result, tmp_path / name) == ["tradeoff"]
    for name, begin in (("tradeoff.png", b"\x89PNG"), ("tradeoff.svg", b"<?xml")):
        picture = (tmp_path / "a" / name).read_bytes()
        assert picture.startswith(begin) and picture == (tmp_path / "b" / name).read_bytes(), name


def test_three_sentences_with_the_figures_of_the_measurement(result):
    sentences = advice(result)
    assert len(sentences) == 3 and all(s.endswith(".") for s in sentences)
    paper = next(p for p in result["points"] if p["name"] == "paper")
    assert f"its error at the worst pixel {paper['error']['max'] * 255:.2g}/255" in sentences[0]


def test_the_factor_of_the_cutoff_is_the_largest_of_the_sweep(result):
    """And not that of a point where the stop decides: the dial has none."""
    by_name = {p["name"]: p for p in result["points"]}
    dial = next(dial["points"] for dial in result["dials"] if dial["name"] == "cutoff")
    ratios = [by_name[dial[name]]["error"]["max"] / value for name, value in CUTOFFS.items()]
    assert error_over_cutoff(result) == pytest.approx(max(ratios)) and max(ratios) <= 5
