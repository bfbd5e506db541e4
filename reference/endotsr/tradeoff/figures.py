"""Work-precision diagrams from `tradeoff.json`: logarithmic, labelled on the curves, legible without colour.

Colours are those of Okabe and Ito, which people with any common colour blindness tell apart.
"""

import io
from pathlib import Path
from typing import Any

from endotsr.evaluation.curves import UNSIGNED
from endotsr.runs import replace_file
from endotsr.tradeoff.measure import LEVELS
from endotsr.tradeoff.study import cost_of

BLUE, ORANGE, GREEN, PINK, INK, GREY, PALE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#24303a", "#6b7680", "#c9d1d8"
TIME = {"forward": "milliseconds a frame", "both": "milliseconds, forward and reverse"}
FLOOR = 1e-10  # of the error axis, in 1/255: the exact path, with error 0, stands there


def main_figure(result: dict[str, Any]) -> Any:
    """Every setting of the joint sweep, the front and the presets: error against time, and against visits."""
    figure = empty_figure(11.0, 4.9)
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, cost in ((left, "forward"), (right, "visits")):
        _sweep(axes, result, cost)
        _levels(axes, result)
        plain_axes(axes, _cost_name(cost))
        axes.set_ylim(FLOOR / 3, 300)
        axes.set_xlim(axes.get_xlim()[0] / 6, None)
    left.set_ylabel("largest error of the image, 1/255", color=INK)
    left.set_title("What a frame costs in time", loc="left", color=INK, fontsize=11)
    right.set_title("and in work that no machine changes", loc="left", color=INK, fontsize=11)
    return figure


def _sweep(axes: Any, result: dict[str, Any], cost: str) -> None:
    by_name = {p["name"]: p for p in result["points"]}
    factor = _factor(cost)

    def at(name: str) -> tuple[float, float]:
        return cost_of(by_name[name], cost) * factor, _height(by_name[name])

    for precision, marker in (("float64", "s"), ("float32", "o")):
        chosen = [at(n) for n in result["joint"] if by_name[n]["setting"]["precision"] == precision]
        if chosen:
            axes.scatter(*zip(*chosen, strict=True), s=16, marker=marker, color=PALE, linewidths=0, zorder=2)
    front = [at(n) for n in result["fronts"][cost] if n not in result["presets"].values()]
    if front:
        axes.plot(*zip(*front, strict=True), color=BLUE, linewidth=1.8, marker="o", markersize=4, zorder=3)
    for name, point in _spaced([n for n in result["fronts"][cost] if n in result["joint"]], at):
        axes.annotate(
            _short(by_name[name]), point, xytext=(-7, -3), textcoords="offset points", ha="right", va="top",
            fontsize=7.5, color=BLUE,
        )  # fmt: skip
    for preset, name in result["presets"].items():
        x, y = at(name)
        axes.plot(x, y, marker="D", color=ORANGE, markersize=7, zorder=4)
        low = preset == "exact"
        axes.annotate(
            f"{preset} (error 0 by definition)" if low else preset, (x, y), xytext=(-9, 0) if low else (8, 5),
            textcoords="offset points", ha="right" if low else "left", va="center" if low else "bottom",
            fontsize=9, color=ORANGE, weight="bold",
        )  # fmt: skip


def _spaced(names: list[str], at: Any, gap: float = 8.0) -> list[tuple[str, tuple[float, float]]]:
    """Points whose errors lie a factor `gap` apart, so that their labels do not touch."""
    found: list[tuple[str, tuple[float, float]]] = []
    for name in names:
        point = at(name)
        if not found or found[-1][1][1] / point[1] > gap:
            found.append((name, point))
    return found


def _short(point: dict[str, Any]) -> str:
    raster, scale = point["setting"]["raster"], point["setting"]["scale"]
    cut = raster["alpha_cutoff"]
    name = f"1/{round(1 / cut)}" if cut > 5e-4 else f"{cut:.0e}".replace("e-0", "e-").replace("e-", "e−")
    half = ", half size" if scale != 1 else ""
    return f"{point['setting']['precision']}, cutoff {name}{half}"


def dials_figure(result: dict[str, Any], cost: str, error: str = "max") -> Any:
    """One panel a dial, on common axes; values beside the points.

    cost    `forward`, `both` or `visits` (dials of the temporal model count basis terms there)
    error   `max` or `gradient`
    """
    dials = [d for d in result["dials"] if cost != "visits" or d["name"] not in ("precision", "exponential", "threads")]
    columns = 4
    rows = -(-len(dials) // columns)
    figure = empty_figure(3.1 * columns, 2.75 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=cost != "visits", sharey=True).ravel()
    by_name = {p["name"]: p for p in result["points"]}
    for axes, dial in zip(panels, dials, strict=False):
        _dial(axes, dial, by_name, cost, error)
        if error == "max":
            _levels(axes, result, named=False)
        counted = "basis terms" if cost == "visits" and dial["cost"] == "terms" else _cost_name(cost)
        plain_axes(axes, counted, small=True)
        axes.set_title(dial["title"], loc="left", fontsize=9.5, color=INK)
        axes.tick_params(labelbottom=True)
    for axes in panels[len(dials) :]:
        axes.set_axis_off()
    name = "largest error, 1/255" if error == "max" else "worst gradient block, relative"
    figure.supylabel(name, fontsize=10, color=INK)
    return figure


def _dial(axes: Any, dial: dict[str, Any], by_name: dict[str, Any], cost: str, error: str) -> None:
    factor = _factor(cost)
    xs, ys = [], []
    for name in dial["points"].values():
        point = by_name[name]
        terms = cost == "visits" and dial["cost"] == "terms"
        xs.append(max(point["terms"], 1) if terms else cost_of(point, cost) * factor)
        ys.append(_height(point, error))
    spreads = [by_name[n][cost] for n in dial["points"].values()] if cost != "visits" else []
    if spreads:
        bars = [
            [(s["median"] - s["low"]) * factor for s in spreads],
            [(s["high"] - s["median"]) * factor for s in spreads],
        ]
        axes.errorbar(xs, ys, xerr=bars, fmt="none", ecolor=PALE, elinewidth=2.2, zorder=1)
    axes.plot(xs, ys, color=GREEN if dial["lossless"] else BLUE, marker="o", markersize=4, linewidth=1.2, zorder=3)
    for position, (label, x, y) in enumerate(zip(dial["points"], xs, ys, strict=True)):
        right = position % 2 == 0
        axes.annotate(
            label, (x, y), xytext=(5 if right else -5, 4 if right else -4), textcoords="offset points", fontsize=7.5,
            ha="left" if right else "right", va="bottom" if right else "top", color=INK,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")


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


def empty_figure(width: float, height: float) -> Any:
    """A white figure of so many inches, drawn without a screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain_axes(axes: Any, name: str, small: bool = False, log_y: bool = True) -> None:
    """Logarithmic axes with a pale grid and nothing else; `name` stands below."""
    axes.set_xscale("log")
    if log_y:
        axes.set_yscale("log")
    axes.set_xlabel(name, fontsize=8 if small else 10, color=INK)
    axes.tick_params(which="both", colors=GREY, labelsize=7.5 if small else 9, length=0)
    axes.grid(True, color=PALE, linewidth=0.5, alpha=0.6)
    axes.set_axisbelow(True)
    for side in axes.spines.values():
        side.set_visible(False)


def save(figure: Any, stem: Path) -> None:
    """stem.png and stem.svg, the same bytes for the same numbers."""
    import matplotlib as mpl

    with mpl.rc_context({"svg.hashsalt": "endotsr", "svg.fonttype": "path"}):
        for ending, about in (("png", UNSIGNED), ("svg", {"Date": None, "Creator": None})):
            buffer = io.BytesIO()
            figure.savefig(buffer, format=ending, dpi=160, metadata=about)
            content = buffer.getvalue()
            replace_file(stem.with_suffix(f".{ending}"), lambda path, data=content: path.write_bytes(data))


def draw(result: dict[str, Any], folder: Path, name: str = "tradeoff") -> list[str]:
    """All pictures of a study; returns the stems that were written."""
    pictures = {name: main_figure(result)} if result["joint"] else {}
    if result["dials"]:
        pictures |= {
            f"{name}_dials": dials_figure(result, "forward"),
            f"{name}_dials_visits": dials_figure(result, "visits"),
            f"{name}_dials_gradients": dials_figure(result, "both", "gradient"),
        }
    for stem, figure in pictures.items():
        save(figure, folder / stem)
    return list(pictures)
