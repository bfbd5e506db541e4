"""Charts from a log that may be short, cut or lack keys."""

import io
import json

import numpy as np
import pytest
from PIL import Image

from endotsr.results.report import curves, style
from endotsr.training.runs.log import log_until


def log_of(count):
    return [
        {
            "iteration": k + 1,
            "loss": 1 / (k + 1),
            "l1": 0.5 / (k + 1),
            "matern_penalty": 0.0,
            "psnr": 20 + k,
            "gaussians": 100 + k,
        }
        for k in range(count)
    ]


def test_cut_and_foreign_lines_of_a_log_are_left_out(tmp_path):
    path = tmp_path / "log.jsonl"
    path.write_text(json.dumps({"iteration": 1, "loss": 2.0}) + '\n[3]\n{"iteration": 2, "lo')
    assert log_until(path, 5) == [{"iteration": 1, "loss": 2.0}] and log_until(path, 0) == []
    assert log_until(tmp_path / "absent", 5) == []


def test_missing_and_null_values_leave_gaps():
    log = [{"iteration": 5, "loss": 1.0}, {"iteration": 6, "loss": None}, {"iteration": 7}, {"iteration": 8, "loss": 3}]
    iterations, values = curves.series(log, "loss")
    assert iterations.tolist() == [5, 8] and values.tolist() == [1, 3]
    assert curves.series(log, "other")[0].shape == (0,)
    assert curves.series([{"loss": float("nan")}, {"loss": 1.0}], "loss")[0].tolist() == [2]


def test_smoothing_keeps_constants_and_length():
    np.testing.assert_allclose(curves.smoothed(np.full(7, 3.0), 5), 3.0)
    np.testing.assert_allclose(curves.smoothed(np.arange(5.0), 3), [0.5, 1, 2, 3, 3.5])
    np.testing.assert_array_equal(curves.smoothed(np.arange(4.0), 1), np.arange(4.0))


def test_only_charts_with_data_appear():
    assert curves.charts([]) == []
    assert curves.curves_png([]) is None
    assert [c.title for c in curves.charts([{"loss": 1.0}])] == ["Loss"]
    assert len(curves.charts(log_of(3))) == 4


@pytest.mark.parametrize("count", [1, 2, 300])
def test_charts_are_drawn_in_both_themes(count):
    evaluation = {"held_out": {"mean": {"psnr_tissue": 30.0}}, "training": {"mean": {"psnr_tissue": None}}}
    for chart in curves.charts(log_of(count), evaluation):
        pictures = [np.asarray(Image.open(io.BytesIO(curves.chart_png(chart, t, dots=40)))) for t in curves.THEMES]
        assert pictures[0].shape[2] == 4 and (pictures[0][0, 0, 3] == 0)  # transparent ground
        assert (pictures[0] != pictures[1]).any()
    Image.open(io.BytesIO(curves.curves_png(log_of(count), evaluation) or b"")).load()


def test_the_names_of_many_curves_cover_none_of_them():
    """A smoothness of 100 is far above the other terms; the legend lay over it."""
    values = {"l1": 0.05, "ssim": 0.8, "depth": 0.02, "smoothness": 100.0, "matern_penalty": 1e-4, "laplacian": 0.01}
    rng = np.random.default_rng(0)
    log = [{"iteration": k, **{key: v * rng.uniform(0.7, 1.2) for key, v in values.items()}} for k in range(1, 121)]
    (chart,) = (c for c in curves.charts(log) if c.title == "Loss terms, before their weights")
    figure = style.new_figure(4.4, 2.75, constrained=False)
    axes = figure.add_subplot()
    curves.draw_chart(axes, chart, style.LIGHT, title=False)
    figure.draw_without_rendering()
    box = axes.get_legend().get_window_extent(figure.canvas.get_renderer())
    assert len(axes.lines) == 6 and box.y1 <= axes.bbox.y1
    for line in axes.lines:
        ends = line.get_transform().transform(line.get_xydata())
        assert not box.count_contains(ends), line.get_label()


def test_levels_of_the_frames_are_of_the_tissue_as_the_curve_is():
    """The log has the PSNR of the tissue; that of all pixels is higher by the fraction of the mask."""
    mean = {"psnr_full": 33.0, "psnr_tissue": 30.0}
    evaluation = {"held_out": {"mean": mean}, "training": {"mean": mean | {"psnr_tissue": 31.0}}}
    (chart,) = (c for c in curves.charts(log_of(3), evaluation) if c.title.startswith("PSNR"))
    axes = style.new_figure(4, 3).add_subplot()
    chart.draw(axes, style.LIGHT)
    assert "tissue" in chart.title and [line.get_ydata()[0] for line in axes.lines[1:]] == [30.0, 31.0]


def test_loss_that_is_zero_or_negative_everywhere_is_still_drawn():
    for value in (0.0, -1.0):
        chart = curves.charts([{"iteration": k, "loss": value} for k in range(3)])[0]
        assert curves.chart_png(chart, "light", dots=40)


def test_frame_chart_leaves_out_null_values():
    rows = [{"frame": 1, "psnr_tissue": 30.0}, {"frame": 9, "psnr_tissue": None}]
    evaluation = {"held_out": {"per_frame": rows}, "baselines": {"two_neighbours": {"per_frame": rows[1:]}}}
    (line,) = curves.frame_lines(evaluation, "psnr_tissue")
    assert line[0] == "Model" and line[1].tolist() == [1]
    assert curves.frame_chart({}, "psnr_tissue") is None


def test_similarity_is_drawn_as_what_is_minimised():
    assert curves.minimised({"ssim": 0.75}, "ssim") == 0.25
    assert curves.minimised({"l1": 0.75}, "l1") == 0.75
    assert curves.minimised({"l1": None}, "l1") is None


@pytest.mark.parametrize("last", [6690, 9550, 95500])
def test_no_number_on_an_axis_is_cut_off_at_the_edge(last):
    log = [{**entry, "iteration": 1 + round(k * (last - 1) / 59)} for k, entry in enumerate(log_of(60))]
    for chart in curves.charts(log):
        seen = np.asarray(Image.open(io.BytesIO(curves.chart_png(chart, "light"))))[..., 3]
        assert not seen[:, -2:].any() and not seen[:, :2].any() and not seen[-2:].any(), chart.title


def test_terms_without_a_positive_value_have_no_chart():
    """A logarithmic axis has no place for them: the chart was empty."""
    assert curves.charts([{"iteration": 1, "depth": 0.0, "ssim": 1.0}]) == []
    assert [c.title for c in curves.charts([{"iteration": 1, "depth": 0.0, "ssim": 0.5}])] == [
        "Loss terms, before their weights"
    ]


def test_more_terms_than_colours_have_dashed_curves(monkeypatch):
    names = tuple(f"term {k}" for k in range(len(style.LIGHT.colours) + 2))
    monkeypatch.setattr(curves, "TERMS", names)
    log = [{"iteration": k, "loss": 1.0, **dict.fromkeys(names, 1.0 + k)} for k in range(3)]
    (chart,) = (chart for chart in curves.charts(log) if "terms" in chart.title.lower())
    axes = style.new_figure(4, 3).add_subplot()
    chart.draw(axes, style.LIGHT)
    drawn = [(line.get_color(), line.get_linestyle()) for line in axes.lines]
    assert len(set(drawn)) == len(names) and [dashes for _, dashes in drawn][-2:] == ["--", "--"]


def test_the_level_of_the_held_out_frames_is_that_of_the_tables():
    """Extrapolated frames are not in the means of the tables and cards."""
    rows = [{"frame": frame, "name": "", "time": 0.0, "psnr_tissue": value} for frame, value in ((1, 30.0), (9, 20.0))]
    evaluation = {"held_out": {"mean": {"psnr_tissue": 25.0}, "per_frame": rows}, "frames": {"extrapolated": [9]}}
    (chart,) = curves.charts([{"iteration": 1, "psnr": 20.0}], evaluation)
    axes = style.new_figure(4, 3).subplots()
    curves.draw_chart(axes, chart, style.LIGHT, title=False)
    assert "held-out frames, end 30.00" in axes.get_legend_handles_labels()[1]
