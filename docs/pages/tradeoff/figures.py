"""Pictures of the page: error against cost from `tradeoff.json`, held-out quality against time from `training.json`."""

from pathlib import Path
from typing import Any

from endotsr.results.report.labels import Label, place_labels
from endotsr.results.report.style import GREY, LIGHT, SMALL, name_axes, new_figure, save
from endotsr.studies.tradeoff.figure import logarithmic_axes, main_figure
from endotsr.studies.tradeoff.results import Measurement


def save_pictures(pictures: dict[str, Any], folder: Path) -> list[str]:
    """Write every figure as STEM.png and STEM.svg; returns the stems."""
    for stem, figure in pictures.items():
        for ending in ("png", "svg"):
            save(figure, folder / f"{stem}.{ending}")
    return list(pictures)


def draw(result: Measurement, folder: Path, name: str = "tradeoff") -> list[str]:
    """The picture of a study; returns the written stems."""
    return save_pictures({name: main_figure(result)}, folder) if result["joint"] else []


def training_figure(result: dict[str, Any]) -> Any:
    """PSNR against time: one panel per question, the base in grey with the trainings that answer it."""
    by_name = {c["name"]: c for c in result["configurations"]}
    dials = [d for d in dict.fromkeys(c["dial"] for c in result["configurations"]) if d != "base"] or ["base"]
    rows, columns = -(-len(dials) // 3), min(3, len(dials))
    figure = new_figure(3.1 * columns, 2.6 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    labels = []
    for axes, dial in zip(panels, dials, strict=False):
        same = [c for c in result["configurations"] if c["dial"] == dial and dial != "base"]
        lines = [(c, LIGHT.colours[i % 4]) for i, c in enumerate(same)]
        lines += [(by_name["base"], GREY)] if "base" in by_name else []
        labels += [_line(axes, configuration, colour) for configuration, colour in lines]
        logarithmic_axes(axes, "minutes of training", SMALL, title=dial, log_y=False)
        name_axes(axes, y="PSNR, dB", sizes=SMALL)
        axes.label_outer()
    for axes in panels[len(dials) :]:
        axes.set_axis_off()
    _room(panels[: len(dials)])
    place_labels(figure, labels)
    return figure


def _line(axes: Any, configuration: dict[str, Any], colour: str) -> Label:
    """Draw one curve; returns the label at its end."""
    rows = [row for row in configuration["milestones"] if row["psnr_full"] is not None]
    xs, ys = [row["seconds"] / 60 for row in rows], [row["psnr_full"] for row in rows]
    axes.plot(xs, ys, color=colour, linewidth=1.4, marker="o", markersize=3)
    return Label(axes, configuration["name"], xs[-1], ys[-1], colour, 8, "bold")


def _room(panels: Any) -> None:
    """Set plain numbers along the common axis, and space for the labels at the right."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    low, high = panels[0].get_xlim()
    panels[0].set_xlim(low, high * (high / low) ** 0.25)
    bottom, top = panels[0].get_ylim()
    panels[0].set_ylim(bottom, top + 0.12 * (top - bottom))
    for axes in panels:
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 200 * low else (1,)))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def draw_training(result: dict[str, Any], folder: Path, name: str) -> list[str]:
    """PSNR against time; returns the written stems."""
    return save_pictures({name: training_figure(result)}, folder) if result["configurations"] else []
