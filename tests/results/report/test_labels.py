"""Labels of charts: none covers another, a point or a line, as long as there is room."""

import numpy as np
import pytest

from endotsr.results.report.labels import Label, line_points, place_labels, text_box
from endotsr.results.report.style import new_figure


def chart(points):
    """A curve through the points, each with a label, and the boxes of the labels in pixels."""
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    axes.plot(*zip(*points), marker="o")
    axes.axhline(0.5, linestyle="--")
    axes.set(xlim=(-1, 2), ylim=(-1, 2))
    place_labels(figure, [Label(axes, f"a longer name {k}", x, y, "black") for k, (x, y) in enumerate(points)])
    renderer = figure.canvas.get_renderer()
    return axes, [text_box(text, renderer) for text in axes.texts]


@pytest.mark.parametrize("points", [[(0, 0), (0, 1)], [(0, 0), (1, 1)], [(0, 0.45), (0.1, 0.55), (0.2, 0.45)]])
def test_labels_keep_off_lines_points_and_each_other(points):
    axes, boxes = chart(points)
    assert len(boxes) == len(points)
    assert [box.count_contains(line_points(axes)) for box in boxes] == [0] * len(points)
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    assert not any(box.count_contains(axes.transData.transform(np.array(points))) for box in boxes)


def test_a_gap_in_a_line_leaves_its_other_parts():
    axes = new_figure(6.0, 4.0).subplots()
    axes.plot([0, 1, 2, 3, 4], [0, 0, np.nan, 0, 0])
    axes.set(xlim=(0, 4), ylim=(-1, 1))
    found = axes.transData.inverted().transform(line_points(axes))[:, 0]
    assert ((found > 0.2) & (found < 0.8)).any() and ((found > 3.2) & (found < 3.8)).any()
    assert not ((found > 1.01) & (found < 2.99)).any()


def test_of_labels_at_one_point_those_in_the_first_colour_are_kept():
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    axes.set(xlim=(-1, 1), ylim=(-1, 1))
    place_labels(figure, [Label(axes, name, 0, 0, colour) for name, colour in (("a", "k"), ("b", "k"), ("c", "r"))])
    assert [text.get_text() for text in axes.texts] == ["a, b"]
