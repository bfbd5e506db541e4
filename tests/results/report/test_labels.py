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
