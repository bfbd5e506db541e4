"""A small line chart as SVG text, without matplotlib, for a page that is rewritten during training.

The surrounding page defines the colours, in a light and a dark scheme.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.results.report.parts import text

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 460.0, 240.0, 52.0, 10.0, 30.0, 30.0  # pixels; the last four are margins
MOST_POINTS = 300  # per curve; more points are averaged in groups
COLOURS = ("var(--accent)", "var(--bad)", "var(--good)")
LINES = 4  # approximate number of grid lines
MOST_DIGITS = 9  # of a label


class ChartCurve(NamedTuple):
    """A named curve with ascending x."""

    name: str
    x: list[float]
    y: list[float]


def chart_svg(
    title: str, curves: list[ChartCurve], end: float, *, logarithmic: bool = False, unit: str = "iteration"
) -> str:
    """The chart; "" if no curve has a finite value (on a logarithmic axis: a positive one).

    end           upper end of the horizontal axis, which begins at 0
    logarithmic   use a logarithmic vertical axis
    unit          what the horizontal axis counts
    """
    shown = [(curve.name, points) for curve in curves if (points := _points(curve, logarithmic)).size]
    if not shown:
        return ""
    values = np.concatenate([points[:, 1] for _, points in shown])
    ticks = (_decades if logarithmic else _ticks)(float(values.min()), float(values.max()))
    low, high = min(ticks[0], float(values.min())), max(ticks[-1], float(values.max()))
    across = (WIDTH - LEFT - RIGHT) / max(end, 1.0)
    down = (HEIGHT - TOP - BOTTOM) / max(high - low, 1e-12)
    apart = (WIDTH - LEFT - RIGHT) / len(shown)  # of the names
    labels = _labels([10.0**at if logarithmic else at for at in ticks])
    parts = [_grid_line(HEIGHT - BOTTOM - down * (at - low), label) for at, label in zip(ticks, labels, strict=True)]
    for number, (name, points) in enumerate(shown):
        colour, where = COLOURS[number % len(COLOURS)], points * [across, -down] + [LEFT, HEIGHT - BOTTOM + down * low]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in where)
        end_x, end_y = where[-1]
        parts.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2" stroke-linejoin="round"/>'
            f'<circle cx="{end_x:.1f}" cy="{end_y:.1f}" r="3.5" fill="{colour}"/>'
            f'<text x="{LEFT + apart * number:.0f}" y="14" fill="{colour}">{text(name)}</text>'
        )
    parts.append(f'<text x="{LEFT}" y="{HEIGHT - 8}">0</text>')
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 8}" text-anchor="end">{unit} {end:.0f}</text>')
    return (
        f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="{text(title)}" fill="var(--soft)"'
        f' font-size="13">{"".join(parts)}</svg>'
    )


def _points(curve: ChartCurve, logarithmic: bool) -> NDArray[np.float64]:
    """(n, 2) finite points, averaged in groups to at most `MOST_POINTS`; for a logarithmic axis y is log10."""
    table = np.array([curve.x, curve.y], np.float64).T.reshape(-1, 2)
    table = table[np.isfinite(table).all(axis=1)]
    if logarithmic:
        table = table[table[:, 1] > 0]
        table[:, 1] = np.log10(table[:, 1])
    groups = np.array_split(table, min(len(table), MOST_POINTS)) if len(table) else []
    return np.array([group.mean(axis=0) for group in groups]).reshape(-1, 2)


def _ticks(low: float, high: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten from low to high; both ends if there are none."""
    step = (high - low) / LINES
    if not step > 0:
        return [low]
    power = 10.0 ** math.floor(math.log10(step))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= step)
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)] or [low, high]


def _decades(low: float, high: float) -> list[float]:
    """log10 of the powers of ten from low to high; on a short axis also of their multiples by 2 and 5.

    Both ends if there are none.
    """
    factors = (1, 2, 5) if high - low < 2 else (1,)
    found = [k + math.log10(factor) for k in range(math.floor(low), math.ceil(high) + 1) for factor in factors]
    return [at for at in found if low <= at <= high] or [low, high]


def _labels(values: list[float]) -> list[str]:
    """Values with three digits, or with as many as keep their rounding below a tenth of the least distance of two."""
    apart = min((b - a for a, b in pairwise(values)), default=math.inf)
    for digits in range(3, MOST_DIGITS):
        rounded = [float(f"{value:.{digits}g}") for value in values]
        if all(abs(shown - value) <= 0.1 * apart for shown, value in zip(rounded, values)):
            break
    return [f"{shown:.{MOST_DIGITS}g}" for shown in rounded]


def _grid_line(y: float, label: str) -> str:
    return (
        f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="var(--line)"/>'
        f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{label}</text>'
    )
