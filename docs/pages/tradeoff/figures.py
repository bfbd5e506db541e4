"""Each dial of the renderer separately, from `tradeoff.json`: a panel of the error against the cost for every dial."""

import math
from pathlib import Path
from typing import Any

from endotsr.results.report.labels import Label, place_labels
from endotsr.results.report.style import BLUE, FAINT, GREEN, INK, NORMAL, SMALL, new_figure, save
from endotsr.studies.tradeoff.figure import (
    FLOOR,
    cost_factor,
    cost_name,
    draw_levels,
    error_height,
    logarithmic_axes,
    main_figure,
)
from endotsr.studies.tradeoff.study import cost_of


def dials_figure(result: dict[str, Any], cost: str, error: str = "max") -> Any:
    """One panel per dial, on common axes, with labelled points.

    cost    `forward`, `both` or `visits` (dials of the temporal model count basis terms there)
    error   `max` or `gradient`
    """
    dials = [d for d in result["dials"] if cost != "visits" or d["name"] not in ("precision", "exponential", "threads")]
    columns = 4
    rows = -(-len(dials) // columns)
    figure = new_figure(3.1 * columns, 2.75 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    by_name = {p["name"]: p for p in result["points"]}
    labels = []
    for axes, dial in zip(panels, dials, strict=False):
        labels += _dial(axes, dial, by_name, cost, error)
        if error == "max":
            draw_levels(axes, result, named=False)
        counted = "basis terms" if cost == "visits" and dial["cost"] == "terms" else cost_name(cost)
        logarithmic_axes(axes, counted, SMALL, title=dial["title"])
        _room(axes)
    for axes in panels[len(dials) :]:
        axes.set_axis_off()
    name = "largest error, 1/255" if error == "max" else "worst gradient block, relative"
    figure.supylabel(name, fontsize=NORMAL.text, color=INK)
    place_labels(figure, labels)
    return figure


def _dial(axes: Any, dial: dict[str, Any], by_name: dict[str, Any], cost: str, error: str) -> list[Label]:
    """Draw one curve; returns the labels of its points."""
    factor = cost_factor(cost)
    points = [by_name[name] for name in dial["points"].values()]
    terms = cost == "visits" and dial["cost"] == "terms"
    xs = [max(p["terms"], 1) if terms else cost_of(p, cost) * factor for p in points]
    ys = [error_height(p, error) for p in points]
    if cost != "visits":
        spreads = [p[cost] for p in points]
        below = [(s["median"] - s["low"]) * factor for s in spreads]
        above = [(s["high"] - s["median"]) * factor for s in spreads]
        axes.errorbar(xs, ys, xerr=[below, above], fmt="none", ecolor=FAINT, elinewidth=2.2, zorder=1)
    axes.plot(xs, ys, color=GREEN if dial["lossless"] else BLUE, marker="o", markersize=4, linewidth=1.2, zorder=3)
    return [Label(axes, label, x, y, INK) for label, x, y in zip(dial["points"], xs, ys, strict=True)]


def _room(axes: Any) -> None:
    """Show at least two decades of cost around the points, for comparable curves and space for labels."""
    from matplotlib.ticker import LogLocator, NullLocator

    low, high = axes.get_xlim()
    middle, reach = math.sqrt(low * high), max(10.0, math.sqrt(high / low) * 3)
    axes.set_xlim(middle / reach, middle * reach)
    axes.set_ylim(FLOOR, 1000)
    axes.xaxis.set_major_locator(LogLocator())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(labelleft=True)


def save_pictures(pictures: dict[str, Any], folder: Path) -> list[str]:
    """Write every figure as STEM.png and STEM.svg; returns the stems."""
    for stem, figure in pictures.items():
        for ending in ("png", "svg"):
            save(figure, folder / f"{stem}.{ending}")
    return list(pictures)


def draw(result: dict[str, Any], folder: Path, name: str = "tradeoff") -> list[str]:
    """All pictures of a study; returns the written stems."""
    pictures = {name: main_figure(result)} if result["joint"] else {}
    if result.get("dials"):
        pictures |= {
            f"{name}_dials": dials_figure(result, "forward"),
            f"{name}_dials_visits": dials_figure(result, "visits"),
            f"{name}_dials_gradients": dials_figure(result, "both", "gradient"),
        }
    return save_pictures(pictures, folder)
