"""Work-precision diagrams from `tradeoff.json`: logarithmic, with labelled curves, legible without colour."""

import math
from pathlib import Path
from typing import Any

from endotsr.results.report.style import (
    BLUE,
    FAINT,
    GREEN,
    GREY,
    INK,
    NORMAL,
    ORANGE,
    SMALL,
    Sizes,
    name_axes,
    new_figure,
    plain_axes,
    save,
)
from endotsr.studies.tradeoff.study import cost_of
from endotsr.studies.tradeoff.text import LEVELS
from pages.tradeoff.labels import Label, place_labels
from pages.tradeoff.text import small

TIME = {"forward": "milliseconds a frame", "both": "milliseconds, forward and reverse"}
FLOOR = 1e-10  # lower end of the error axis, in 1/255, where the exact path with error 0 is drawn


def main_figure(result: dict[str, Any]) -> Any:
    """Every setting of the joint sweep, the front and the presets: error against time, and against visits."""
    figure = new_figure(11.0, 5.0)
    left, right = figure.subplots(1, 2, sharey=True)
    labels = []
    for axes, cost in ((left, "forward"), (right, "visits")):
        labels += _sweep(axes, result, cost)
        _levels(axes, result)
        logarithmic_axes(axes, _cost_name(cost))
        axes.set_ylim(FLOOR / 10, 1000)
        low, high = axes.get_xlim()
        axes.set_xlim(low / 4, high * 2)
    name_axes(left, y="largest error of the image, 1/255", title="Error against time per frame")
    name_axes(right, title="and against visited pairs")
    place_labels(figure, labels)
    return figure


def _sweep(axes: Any, result: dict[str, Any], cost: str) -> list[Label]:
    """Draw the points; returns their labels, presets first."""
    by_name = {p["name"]: p for p in result["points"]}
    factor = _factor(cost)

    def at(name: str) -> tuple[float, float]:
        return cost_of(by_name[name], cost) * factor, _height(by_name[name])

    for precision, marker in (("float64", "s"), ("float32", "o")):
        chosen = [at(n) for n in result["joint"] if by_name[n]["setting"]["precision"] == precision]
        if chosen:
            axes.scatter(*zip(*chosen, strict=True), s=16, marker=marker, color=FAINT, linewidths=0, zorder=2)
    swept = [n for n in result["fronts"][cost] if n in result["joint"]]
    if swept:
        axes.plot(*zip(*map(at, swept), strict=True), color=BLUE, linewidth=1.8, marker="o", markersize=4, zorder=3)
    labels = []
    for preset, name in result["presets"].items():
        axes.plot(*at(name), marker="D", color=ORANGE, markersize=7, zorder=4)
        text = f"{preset} (error 0 by definition)" if by_name[name]["error"]["max"] == 0 else preset
        labels.append(Label(axes, text, *at(name), ORANGE, 9, "bold"))
    return labels + [Label(axes, _short(by_name[name], cost), *at(name), BLUE) for name in swept]


def _short(point: dict[str, Any], cost: str) -> str:
    """Label of a setting: precision (which changes no visit), cutoff, and any other coarse choice."""
    raster, scale = point["setting"]["raster"], point["setting"]["scale"]
    cut, stop = raster["alpha_cutoff"], raster["transmittance_stop"]
    words = [] if cost == "visits" else [point["setting"]["precision"]]
    words.append(f"cutoff {small(cut)}")
    words += [f"stop {stop:.0e}".replace("e-0", "e-")] if stop >= 1e-3 else []
    return ", ".join(words + (["half size"] if scale != 1 else []))


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
            _levels(axes, result, named=False)
        counted = "basis terms" if cost == "visits" and dial["cost"] == "terms" else _cost_name(cost)
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
    factor = _factor(cost)
    points = [by_name[name] for name in dial["points"].values()]
    terms = cost == "visits" and dial["cost"] == "terms"
    xs = [max(p["terms"], 1) if terms else cost_of(p, cost) * factor for p in points]
    ys = [_height(p, error) for p in points]
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


def _height(point: dict[str, Any], error: str = "max") -> float:
    value = point["error"][error]
    return max(value * LEVELS if error == "max" else value, FLOOR)


def _factor(cost: str) -> float:
    return 1.0 if cost == "visits" else 1e3


def _cost_name(cost: str) -> str:
    return "visited pixel-Gaussian pairs" if cost == "visits" else TIME[cost]


def _levels(axes: Any, result: dict[str, Any], named: bool = True) -> None:
    """Half a step of an 8-bit picture, and the noise of the sensor."""
    lines = [(result["lines"]["eight_bit"], "half a step of 8 bit", "--")]
    if result["lines"]["sensor_noise"]:
        lines.append((result["lines"]["sensor_noise"], "sensor noise", ":"))
    for value, label, dashes in lines:
        axes.axhline(value * LEVELS, color=GREY, linestyle=dashes, linewidth=1, zorder=1)
        if named:
            axes.annotate(
                label, (1, value * LEVELS), xycoords=("axes fraction", "data"), xytext=(-3, 2),
                textcoords="offset points", ha="right", va="bottom", fontsize=8, color=GREY,
            )  # fmt: skip


def logarithmic_axes(axes: Any, name: str, sizes: Sizes = NORMAL, title: str = "", log_y: bool = True) -> None:
    """Logarithmic axes in the common style; `name` is the label of the cost axis."""
    axes.set_xscale("log")
    if log_y:
        axes.set_yscale("log")
    name_axes(axes, name, title=title, sizes=sizes)
    plain_axes(axes, sizes=sizes)


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
