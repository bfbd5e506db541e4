"""The results in `training.json`: a table of PSNR by minute, and held-out quality against time."""

from pathlib import Path
from typing import Any

from endotsr.report.style import GREY, LIGHT, SMALL, name_axes, new_figure
from endotsr.report.tables import plain
from endotsr.report.words import duration
from endotsr.tradeoff.figures import logarithmic_axes, save_pictures
from endotsr.tradeoff.labels import Label, place_labels

METRICS = {"psnr_full": "PSNR, dB", "ssim_full": "SSIM", "lpips": "LPIPS"}
ALONG = {"seconds": "minutes of training", "iteration": "iterations"}


def training_lines(result: dict[str, Any]) -> list[str]:
    """Text for the terminal: the final state of every training beside the base, then the gain of each interval."""
    rows = training_rows(result)
    lines = [plain(("training", "PSNR", "to base", "SSIM", "LPIPS", "time", "to base", "Gaussians"), rows)]
    lines += [f"left out: {name} ({reason})" for name, reason in result["left_out"].items()]
    return lines + summary(result) + gain_by_minute(best_by_time(result))


def summary(result: dict[str, Any]) -> list[str]:
    """The variation by rounding alone, and the trainings that a faster one exceeded by more than that variation."""
    ends = {c["name"]: (c["seconds"], c["milestones"][-1]["psnr_full"]) for c in result["configurations"]}
    if "base" not in ends or None in [psnr for _, psnr in ends.values()]:
        return []
    chance, lines = 0.0, []
    if "float64" in ends:
        chance = abs(ends["float64"][1] - ends["base"][1])
        lines.append(
            f"one seed each: `float64` differs from `base` by rounding alone and ends {chance:.2f} dB from it, "
            "so that is how far chance goes here"
        )
    beaten = {
        name: [other for other, (time, best) in ends.items() if time < seconds and best > psnr + chance]
        for name, (seconds, psnr) in ends.items()
    }
    kept = [name for name in sorted(ends, key=lambda n: ends[n]) if not beaten[name]]
    lines.append(f"nothing was both faster and better by more than chance than: {', '.join(kept)}")
    lines += [f"{name}: beaten by {', '.join(others)}" for name, others in beaten.items() if others]
    return lines


def training_rows(result: dict[str, Any]) -> list[list[str]]:
    """Name, PSNR, gain on the base, SSIM, LPIPS, time, time over that of the base, Gaussians."""
    by_name = {c["name"]: c for c in result["configurations"]}
    if "base" not in by_name:
        return []
    base = by_name["base"]["milestones"][-1]
    rows = []
    for c in result["configurations"]:
        last = c["milestones"][-1]
        cells = [
            f"{last['psnr_full']:.2f}",
            f"{last['psnr_full'] - base['psnr_full']:+.2f}",
            f"{last['ssim_full']:.4f}",
        ]
        cells.append("-" if last["lpips"] is None else f"{last['lpips']:.4f}")
        cells += [duration(last["seconds"]), f"{last['seconds'] / base['seconds']:.2f}x", str(last["gaussians"])]
        rows.append([c["name"], *cells])
    return rows


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


def gain_by_minute(states: list[dict[str, Any]], least: float = 0.3, stretch: float = 1.5) -> list[str]:
    """The best states: time, training, and gain per minute since the state before.

    least, stretch   a state is listed if it is `least` dB better and `stretch` times later than the last listed one
    """
    lines: list[str] = []
    before: dict[str, Any] | None = None
    for row in states:
        if before is not None and row is not states[-1]:
            if row["psnr_full"] < before["psnr_full"] + least or row["seconds"] < stretch * before["seconds"]:
                continue
        line = (
            f"after {duration(row['seconds'])}: {row['psnr_full']:.2f} dB ({row['name']}, iteration {row['iteration']})"
        )
        if before is not None:
            minutes = (row["seconds"] - before["seconds"]) / 60
            line += f", {(row['psnr_full'] - before['psnr_full']) / max(minutes, 1e-9):.2f} dB a minute"
        lines.append(line)
        before = row
    return lines


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
