"""Work-precision diagram from `tradeoff.json`: logarithmic, with labelled curves, legible without colour."""

from typing import Any

from endotsr.results.report.labels import Label, place_labels
from endotsr.results.report.style import BLUE, FAINT, GREY, NORMAL, ORANGE, Sizes, name_axes, new_figure, plain_axes
from endotsr.studies.tradeoff.results import Measurement, Point
from endotsr.studies.tradeoff.study import Cost, cost_of
from endotsr.studies.tradeoff.text import LEVELS, small

COSTS: dict[Cost, tuple[str, float]] = {  # label, factor
    "forward": ("milliseconds a frame", 1e3),
    "visits": ("visited pixel-Gaussian pairs", 1.0),
}
FLOOR = 1e-10  # error, in 1/255, at which the exact path with error 0 is drawn; the axis begins a tenth lower


def main_figure(result: Measurement) -> Any:
    """Every setting of the joint sweep, the front and the presets: error against time, and against visits."""
    figure = new_figure(11.0, 5.0)
    left, right = figure.subplots(1, 2, sharey=True)
    labels = []
    for axes, cost in zip((left, right), COSTS, strict=True):
        labels += _sweep(axes, result, cost)
        _draw_levels(axes, result)
        logarithmic_axes(axes, COSTS[cost][0])
        axes.set_ylim(FLOOR / 10, 1000)
        low, high = axes.get_xlim()
        axes.set_xlim(low / 4, high * 2)
    name_axes(left, y="largest error of the image, 1/255", title="Error against time per frame")
    name_axes(right, title="and against visited pairs")
    place_labels(figure, labels)
    return figure


def _sweep(axes: Any, result: Measurement, cost: Cost) -> list[Label]:
    """Draw the points; returns their labels, presets first."""
    by_name = {p["name"]: p for p in result["points"]}
    factor = COSTS[cost][1]

    def at(name: str) -> tuple[float, float]:
        return cost_of(by_name[name], cost) * factor, max(by_name[name]["error"]["max"] * LEVELS, FLOOR)

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


def _short(point: Point, cost: Cost) -> str:
    """Label of a setting: precision (which hardly changes the visits), cutoff, and any other coarse choice."""
    raster, scale = point["setting"]["raster"], point["setting"]["scale"]
    cut, stop = raster["alpha_cutoff"], raster["transmittance_stop"]
    words = [] if cost == "visits" else [point["setting"]["precision"]]
    words.append(f"cutoff {small(cut)}")
    words += [f"stop {stop:.0e}".replace("e-0", "e-")] if stop >= 1e-3 else []
    return ", ".join(words + (["half size"] if scale != 1 else []))


def _draw_levels(axes: Any, result: Measurement) -> None:
    """Half a step of an 8-bit picture, and the noise of the sensor."""
    lines = [(result["lines"]["eight_bit"], "half a step of 8 bit", "--")]
    if result["lines"]["sensor_noise"]:
        lines.append((result["lines"]["sensor_noise"], "sensor noise", ":"))
    for value, label, dashes in lines:
        axes.axhline(value * LEVELS, color=GREY, linestyle=dashes, linewidth=1, zorder=1)
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
