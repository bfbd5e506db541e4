"""Held-out quality against time and iterations, from `training.json`."""

from pathlib import Path
from typing import Any

from tradeoff_figures import logarithmic_axes, save_pictures
from tradeoff_labels import Label, place_labels

from endotsr.report.style import GREY, LIGHT, SMALL, name_axes, new_figure

METRICS = {"psnr_full": "PSNR, dB", "ssim_full": "SSIM", "lpips": "LPIPS"}
ALONG = {"seconds": "minutes of training", "iteration": "iterations"}


def training_figure(result: dict[str, Any], along: str, metrics: dict[str, str]) -> Any:
    """One column a question, the base in grey beside the trainings that answer it; one row a metric."""
    by_name = {c["name"]: c for c in result["configurations"]}
    dials = [d for d in dict.fromkeys(c["dial"] for c in result["configurations"]) if d != "base"] or ["base"]
    rows, columns = (len(metrics), len(dials)) if len(metrics) > 1 else (-(-len(dials) // 3), min(3, len(dials)))
    figure = new_figure(3.1 * columns, 2.6 * rows)
    common_y = "row" if len(metrics) > 1 else True
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=common_y).ravel()
    shown = [(metric, dial) for metric in metrics for dial in dials]
    labels = []
    for axes, (metric, dial) in zip(panels, shown, strict=False):
        same = [c for c in result["configurations"] if c["dial"] == dial and dial != "base"]
        lines = [(c, LIGHT.colours[i % 4]) for i, c in enumerate(same)]
        lines += [(by_name["base"], GREY)] if "base" in by_name else []
        labels += [_line(axes, configuration, colour, along, metric) for configuration, colour in lines]
        logarithmic_axes(axes, ALONG[along], SMALL, title=dial, log_y=False)
        name_axes(axes, y=metrics[metric], sizes=SMALL)
        axes.label_outer()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    _room(panels[: len(shown)])
    place_labels(figure, labels)
    return figure


def _line(axes: Any, configuration: dict[str, Any], colour: str, along: str, metric: str) -> Label:
    """Draw one curve; returns the label at its end."""
    rows = [r for r in configuration["milestones"] if r[metric] is not None]
    xs = [r[along] / (60 if along == "seconds" else 1) for r in rows]
    ys = [r[metric] for r in rows]
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
    """PSNR against time, and all metrics against time and iterations; returns the stems that were written."""
    if not result["configurations"]:
        return []
    last = result["configurations"][0]["milestones"][-1]
    metrics = {k: v for k, v in METRICS.items() if last[k] is not None}
    pictures = {
        name: training_figure(result, "seconds", {"psnr_full": METRICS["psnr_full"]}),
        f"{name}_seconds": training_figure(result, "seconds", metrics),
        f"{name}_iterations": training_figure(result, "iteration", metrics),
    }
    return save_pictures(pictures, folder)
