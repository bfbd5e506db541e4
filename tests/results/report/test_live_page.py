"""The page of a training that runs: it follows the run, changes no number of it, and gives way to the report."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "cli"))

from tiny import assert_same_run, train_words

from endotsr.cli.main import main
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.results.report import line_chart, live_page
from endotsr.results.report.line_chart import ChartCurve, chart_svg
from endotsr.training.runs.folder import open_run
from endotsr.training.runs.model import load_training
from endotsr.training.runs.sources import load_run_sequence


@pytest.fixture(scope="module")
def quiet_run(tmp_path_factory):
    """A run whose page is written at its ends alone, and its page before and after the evaluation."""
    out = tmp_path_factory.mktemp("quiet") / "run"
    assert main(train_words(out, "--no-evaluate")) == 0
    before = (out / "training.html").read_text(encoding="utf-8")
    assert main(["evaluate", str(out), "--no-view"]) == 0
    return out, before, (out / "training.html").read_text(encoding="utf-8")


@pytest.fixture
def pages(monkeypatch):
    """Every page of the runs of a test; one is due at every iteration."""
    found, replace = [], live_page.replace_text

    def kept(path, text):
        replace(path, text)
        found.append(path.read_text(encoding="utf-8"))

    monkeypatch.setattr(live_page, "FEWEST_SECONDS", 0.0)
    monkeypatch.setattr(live_page, "MOST_SECONDS", 0.0)
    monkeypatch.setattr(live_page, "replace_text", kept)
    return found


def test_the_page_follows_the_run_at_every_iteration_and_changes_no_bit_of_it(quiet_run, pages, tmp_path):
    assert main(train_words(tmp_path / "run", "--no-evaluate")) == 0
    assert_same_run(quiet_run[0], tmp_path / "run")
    assert len(pages) == 1 + 30 + 1
    assert "<img" not in pages[0], "nothing is rendered before the kernels are compiled"
    assert ">7</b><span>of 30 iterations<" in pages[7] and "frame 1 after iteration 7" in pages[7]
    assert "time left" in pages[7] and re.search(r"<b>\d:\d\d</b><span>time left", pages[7])
    assert pages[7].count("<img") == 2 and pages[7].count("<polyline") == 3
    assert "<b>finished</b>" in pages[-1] and 'http-equiv="refresh"' in pages[7]
    number = re.search(r"<b>([\d.]+)<small>dB</small></b><span>PSNR of held-out frame 1", pages[-1])
    assert float(number[1]) > float(re.search(r"<b>([\d.]+)<small>dB", pages[1])[1]), "the frame was learned"


def test_a_stop_before_the_first_iteration_renders_nothing(pages, monkeypatch, tmp_path, capsys):
    """A render would compile the kernels after the stop, which takes a minute."""

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("endotsr.training.fitting.compile_ahead.compile_ahead", stopped)
    monkeypatch.setattr(live_page, "render_at", pytest.fail)
    assert main(train_words(tmp_path / "my run", "--no-evaluate")) == 130
    assert "<b>interrupted</b>" in pages[-1] and "<img" not in pages[-1]
    assert f"<code>endotsr train --out &#x27;{tmp_path}/my run&#x27; --resume</code>" in pages[-1]


def test_the_page_leads_to_the_report_once_there_is_one(quiet_run):
    _, before, after = quiet_run
    assert "report.html" not in before and 'content="0; url=report.html"' in after


def test_a_resumed_run_goes_on_with_its_curves(pages, tmp_path):
    out = tmp_path / "run"
    assert main(train_words(out, "--no-evaluate")) == 0
    pages.clear()
    assert main(["train", "--out", str(out), "--resume", "--iterations", "32", "--no-evaluate"]) == 0
    first = re.search(r'<polyline points="([^"]*)"', pages[1])
    assert len(first[1].split()) == 31, "the thirty iterations before are shown"


def test_the_page_measures_the_clipped_render_as_the_report_does(quiet_run, monkeypatch, tmp_path):
    folder = open_run(shutil.copytree(quiet_run[0], tmp_path / "run"))
    sequence, render_at = load_run_sequence(folder), live_page.render_at

    def bright(*words, **more):
        found = render_at(*words, **more)
        return found._replace(colour=found.colour + 2)

    monkeypatch.setattr(live_page, "render_at", bright)
    page = live_page.LivePage(folder, sequence, folder.config())
    page.begin(load_training(folder, folder.config()))
    page.close()
    truth = sequence.frame(1).image
    white = psnr_tissue(np.ones_like(truth), truth, sequence.masks[1])
    assert f"<b>{white:.2f}<small>dB" in (folder.path / "training.html").read_text(encoding="utf-8")


def test_a_page_that_cannot_be_written_stops_no_training(monkeypatch, tmp_path):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(live_page, "replace_text", full)
    assert main(train_words(tmp_path / "run", "--no-evaluate")) == 0
    assert not (tmp_path / "run" / "training.html").exists()


def test_a_chart_holds_the_ends_and_the_means_of_its_curve(monkeypatch):
    monkeypatch.setattr(line_chart, "MOST_POINTS", 2)
    svg = chart_svg("<Loss>", [ChartCurve("<a>", [1, 2, 3, 4], [1.0, 3.0, 5.0, 7.0])], 4)
    (x0, y0), (x1, y1) = (map(float, pair.split(",")) for pair in re.search(r'points="([^"]*)"', svg)[1].split())
    across = (line_chart.WIDTH - line_chart.LEFT - line_chart.RIGHT) / 4
    assert x0 == pytest.approx(line_chart.LEFT + 1.5 * across, abs=0.1) and x1 - x0 == pytest.approx(
        2 * across, abs=0.1
    )
    assert y0 == line_chart.HEIGHT - line_chart.BOTTOM and y1 == line_chart.TOP, "2 is the lowest and 6 the highest"
    assert "&lt;a&gt;" in svg and "<a>" not in svg


def test_the_names_of_three_curves_end_within_the_chart():
    """`z, arbitrary unit` of a path was cut off; a letter of this size is about 7 pixels wide."""
    names = [f"{axis}, arbitrary unit" for axis in "xyz"]
    svg = chart_svg("path", [ChartCurve(name, [0, 1], [0.0, 1.0]) for name in names], 1)
    starts = [float(x) for x in re.findall(r'<text x="([\d.]+)" y="14"', svg)]
    ends = [start + 7 * len(name) for start, name in zip(starts, names)]
    assert starts[0] == line_chart.LEFT and max(ends) <= line_chart.WIDTH
    assert all(end < start for end, start in zip(ends, starts[1:]))


@pytest.mark.parametrize("y", [[], [float("nan")], [0.0], [-1.0]])
def test_a_curve_without_a_value_that_the_axis_holds_is_no_chart(y):
    assert chart_svg("x", [ChartCurve("x", list(range(len(y))), y)], 3, logarithmic=True) == ""


@pytest.mark.parametrize(("low", "high", "labels"), [
    (30.0, 30.2, ["30", "30.05", "30.1", "30.15", "30.2"]), (0.9981, 0.9993, ["0.9985", "0.999"]),
    (-120.01, -119.99, ["-120.01", "-120", "-119.99"]), (12000.0, 15000.0, ["12000", "13000", "14000", "15000"]),
    (1.0, 7.0, ["2", "4", "6"]), (5.0, 5.0, ["5"]),
])  # fmt: skip
def test_each_grid_line_of_a_chart_has_its_own_label(low, high, labels):
    svg = chart_svg("x", [ChartCurve("x", [0.0, 1.0], [low, high])], 1)
    assert re.findall(r'text-anchor="end">([^<]*)<', svg)[:-1] == labels


def test_ticks_of_a_flat_curve_and_of_a_logarithmic_axis():
    assert "polyline" in chart_svg("x", [ChartCurve("x", [1, 2], [5.0, 5.0])], 2)
    svg = chart_svg("x", [ChartCurve("x", [1, 2, 3], [0.001, 0.1, 10.0])], 3, logarithmic=True)
    assert re.findall(r'text-anchor="end">([\d.e-]+)<', svg) == ["0.001", "0.01", "0.1", "1", "10"]
    svg = chart_svg("x", [ChartCurve("x", [1, 2], [0.03, 0.6])], 3, logarithmic=True)
    assert re.findall(r'text-anchor="end">([\d.e-]+)<', svg) == ["0.05", "0.1", "0.2", "0.5"]
