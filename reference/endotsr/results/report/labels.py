"""Labels of points, each at the first position around its point that is free of other labels, points and lines.

A label for which lines leave no position may cross them.
"""

from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.transforms import Bbox

STEP = 3.0  # pixels between the sampled points of a line
COINCIDENT = 4.0  # pixels within which points have one common label
RADII = (6, 13, 22, 34)  # points of the page
DIRECTIONS = ((1, 0.5), (-1, -0.5), (1, -0.5), (-1, 0.5), (0, 1), (0, -1))


class Label(NamedTuple):
    """A name at a point of some axes."""

    axes: Any
    text: str
    x: float
    y: float
    colour: str
    size: float = 7.5
    weight: str = "normal"


def place_labels(figure: Any, labels: list[Label]) -> None:
    """Write the labels and fix the layout of the figure. A label without a free position is omitted."""
    from matplotlib.transforms import Bbox

    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    renderer = figure.canvas.get_renderer()
    for axes in dict.fromkeys(label.axes for label in labels):
        mine = _merged([label for label in labels if label.axes is axes])
        room = Bbox.from_extents(*axes.get_window_extent(renderer).extents).padded(2)
        taken = [text.get_window_extent(renderer) for text in axes.texts]
        taken += [_around(axes.transData.transform((label.x, label.y))) for label in mine]
        lines = line_points(axes)
        for label in mine:
            # A position without lines, or else one without other labels and points.
            box = _write(label, renderer, room, taken, lines) or _write(label, renderer, room, taken, lines[:0])
            if box is not None:
                taken.append(box)


def line_points(axes: Any) -> NDArray[np.float64]:
    """Points in pixels along every line of the axes that is drawn between finite points, (M, 2)."""
    found = [np.empty((0, 2))]
    for line in axes.lines:
        ends = line.get_transform().transform(np.column_stack(line.get_data(orig=False)).astype(float))
        if line.get_linestyle() in ("None", ""):
            continue
        for a, b in pairwise(ends):
            if not (np.isfinite(a).all() and np.isfinite(b).all()):
                continue
            count = max(2, int(np.hypot(*(b - a)) / STEP))
            found.append(a + np.linspace(0, 1, count)[:, None] * (b - a))
    return np.concatenate(found)


def _merged(labels: list[Label]) -> list[Label]:
    """Labels of one point joined by commas, three or more by their first and last, in the colour of the first.

    Labels of another colour at this point are left out.
    """
    groups: list[list[Label]] = []
    for label in labels:
        at = label.axes.transData.transform((label.x, label.y))
        for group in groups:
            there = label.axes.transData.transform((group[0].x, group[0].y))
            if max(abs(at - there)) < COINCIDENT:
                group.append(label)
                break
        else:
            groups.append([label])
    found = []
    for group in groups:
        names = list(dict.fromkeys(label.text for label in group if label.colour == group[0].colour))
        text = ", ".join(names) if len(names) < 3 else f"{names[0]} … {names[-1]}"
        found.append(group[0]._replace(text=text))
    return found


def _around(point: Any) -> "Bbox":
    from matplotlib.transforms import Bbox

    return Bbox.from_bounds(point[0] - 4, point[1] - 4, 8, 8)


def _write(label: Label, renderer: Any, room: "Bbox", taken: "list[Bbox]", lines: NDArray[np.float64]) -> "Bbox | None":
    for radius in RADII:
        for right, up in DIRECTIONS:
            text = label.axes.annotate(
                label.text, (label.x, label.y), xytext=(radius * right, radius * up), textcoords="offset points",
                ha="left" if right > 0 else "right" if right < 0 else "center",
                va="bottom" if up > 0.5 else "top" if up < -0.5 else "center",
                fontsize=label.size, color=label.colour, weight=label.weight,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.4},
                arrowprops={"arrowstyle": "-", "color": label.colour, "linewidth": 0.4} if radius > RADII[0] else None,
            )  # fmt: skip
            box = text_box(text, renderer)
            inside = box.x0 >= room.x0 and box.x1 <= room.x1 and box.y0 >= room.y0 and box.y1 <= room.y1
            crossed = box.padded(1).count_contains(lines) if len(lines) else 0
            if inside and not crossed and not any(box.overlaps(other) for other in taken):
                return box
            text.remove()
    return None


def text_box(text: Any, renderer: Any) -> "Bbox":
    """The box of the text, without the line to the point."""
    from matplotlib.text import Text

    text.update_positions(renderer)
    return Text.get_window_extent(text, renderer)
