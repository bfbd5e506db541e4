"""What `training.json` says to a person: a table of decibels by minute, and held-out quality against time."""

from pathlib import Path
from typing import Any

from endotsr.commands.progress import duration
from endotsr.tradeoff.figures import BLUE, GREEN, GREY, INK, ORANGE, PINK, empty_figure, plain_axes, save
from endotsr.tradeoff.labels import Label, place_labels

METRICS = {"psnr_full": "PSNR, dB", "ssim_full": "SSIM", "lpips": "LPIPS"}
ALONG = {"seconds": "minutes of training", "iteration": "iterations"}
COLOURS = (BLUE, ORANGE, GREEN, PINK)


def training_lines(result: dict[str, Any]) -> list[str]:
    """Every training at its end beside the base, then what each further stretch of time bought."""
    by_name = {c["name"]: c for c in result["configurations"]}
    if "base" not in by_name:
        return ["no training was finished"]
    base = by_name["base"]["milestones"][-1]
    lines = [f"{'training':<16}{'PSNR':>9}{'to base':>9}{'SSIM':>8}{'time':>8}{'to base':>9}{'Gaussians':>11}"]
    for c in result["configurations"]:
        last = c["milestones"][-1]
        gain = last["psnr_full"] - base["psnr_full"]
        lines.append(
            f"{c['name']:<16}{last['psnr_full']:9.2f}{gain:+9.2f}{last['ssim_full']:8.4f}"
            f"{duration(last['seconds']):>8}{last['seconds'] / base['seconds']:8.2f}x{last['gaussians']:11d}"
        )
    lines += [f"left out: {name} ({reason})" for name, reason in result["left_out"].items()]
    return lines + decibels_by_minute(result)


def best_by_time(result: dict[str, Any]) -> list[dict[str, Any]]:
    """The measured states that no other state reached sooner and better, earliest first."""
    rows = [
        row | {"name": c["name"], "change": c["change"]}
        for c in result["configurations"]
        for row in c["milestones"]
        if row["psnr_full"] is not None
    ]
    found: list[dict[str, Any]] = []
    for row in sorted(rows, key=lambda r: (r["seconds"], -r["psnr_full"])):
        if not found or row["psnr_full"] > found[-1]["psnr_full"]:
            found.append(row)
    return found


def decibels_by_minute(result: dict[str, Any]) -> list[str]:
    """Along the best measured states: from when to when, which training, what it gained a minute."""
    lines, before = [], None
    for row in best_by_time(result):
        reached = f"{row['name']} at iteration {row['iteration']}: {row['psnr_full']:.2f} dB"
        if before is None:
            lines.append(f"after {duration(row['seconds'])}: {reached}")
        else:
            minutes = (row["seconds"] - before["seconds"]) / 60
            gain = row["psnr_full"] - before["psnr_full"]
            lines.append(f"after {duration(row['seconds'])}: {reached}, {gain / max(minutes, 1e-9):.2f} dB a minute")
        before = row
    return lines


def training_figure(result: dict[str, Any], along: str, metrics: dict[str, str]) -> Any:
    """One column a question, the base in grey beside the trainings that answer it; one row a metric."""
    by_name = {c["name"]: c for c in result["configurations"]}
    dials = [d for d in dict.fromkeys(c["dial"] for c in result["configurations"]) if d != "base"] or ["base"]
    rows, columns = (len(metrics), len(dials)) if len(metrics) > 1 else (-(-len(dials) // 3), min(3, len(dials)))
    figure = empty_figure(3.1 * columns, 2.6 * rows)
    share = "row" if len(metrics) > 1 else True
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=share).ravel()
    shown = [(metric, dial) for metric in metrics for dial in dials]
    labels = []
    for axes, (metric, dial) in zip(panels, shown, strict=False):
        same = [c for c in result["configurations"] if c["dial"] == dial and dial != "base"]
        lines = [(c, COLOURS[i % len(COLOURS)]) for i, c in enumerate(same)]
        lines += [(by_name["base"], GREY)] if "base" in by_name else []
        labels += [_line(axes, configuration, colour, along, metric) for configuration, colour in lines]
        plain_axes(axes, ALONG[along], small=True, log_y=False)
        axes.set_ylabel(metrics[metric], fontsize=8, color=INK)
        axes.label_outer()
        axes.set_title(dial, loc="left", fontsize=9.5, color=INK)
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    _room(panels[: len(shown)])
    place_labels(figure, labels)
    return figure


def _line(axes: Any, configuration: dict[str, Any], colour: str, along: str, metric: str) -> Label:
    """Draws one curve; returns its name at its end."""
    rows = [r for r in configuration["milestones"] if r[metric] is not None]
    xs = [r[along] / (60 if along == "seconds" else 1) for r in rows]
    ys = [r[metric] for r in rows]
    axes.plot(xs, ys, color=colour, linewidth=1.4, marker="o", markersize=3)
    return Label(axes, configuration["name"], xs[-1], ys[-1], colour, 8, "bold")


def _room(panels: Any) -> None:
    """Plain numbers along the common axis, and a place for the names at the right."""
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
    for stem, figure in pictures.items():
        save(figure, folder / stem)
    return list(pictures)
