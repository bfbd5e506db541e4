"""Charts of a run from its log and its evaluation.

Every chart has a light and a dark version with transparent background. Curves without values in the log are not drawn;
charts without curves are left out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from endotsr.results.evaluation.evaluate import held_out_means
from endotsr.results.evaluation.records import EvaluationRecord
from endotsr.results.report import parts
from endotsr.results.report.style import LIGHT, THEMES, Theme, encoded, legend, name_axes, new_figure, plain_axes
from endotsr.training.fitting.records import TERMS, LogEntry

LogEntries = list[LogEntry]


@dataclass(frozen=True)
class Chart:
    """A titled chart; `draw(axes, theme)` draws the curves on matplotlib axes."""

    title: str
    draw: Callable[[Any, Theme], None]
    along: str = "iteration"  # label of the horizontal axis


def series(log: LogEntries, key: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(iterations, values) of the entries with a finite number under `key`, both (n,)."""
    pairs = [
        (entry.get("iteration", position + 1), value)
        for position, entry in enumerate(log)
        if isinstance(value := entry.get(key), int | float) and math.isfinite(value)
    ]
    table = np.array(pairs, np.float64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def smoothed(values: NDArray[np.float64], window: int) -> NDArray[np.float64]:
    """Centred running mean over `window` entries, one more if it is even, fewer at both ends. (n,) -> (n,)."""
    half = window // 2
    sums = np.concatenate([[0.0], np.cumsum(values)])
    positions = np.arange(values.size)
    start, stop = np.maximum(positions - half, 0), np.minimum(positions + half + 1, values.size)
    return (sums[stop] - sums[start]) / (stop - start)


def charts(log: LogEntries, evaluation: EvaluationRecord | None = None) -> list[Chart]:
    """All charts with data: loss, PSNR, loss terms, Gaussians."""
    found = []
    if series(log, "loss")[0].size:
        found.append(Chart("Loss", lambda axes, theme: _draw_loss(axes, theme, log)))
    if series(log, "psnr")[0].size:
        found.append(Chart("PSNR of the training view, tissue, dB", lambda a, t: _draw_psnr(a, t, log, evaluation)))
    if any(_positive(log, key) for key in TERMS):
        found.append(Chart("Loss terms, before their weights", lambda axes, theme: _draw_terms(axes, theme, log)))
    if series(log, "gaussians")[0].size:
        found.append(Chart("Gaussians", lambda axes, theme: _draw_count(axes, theme, log)))
    return found


def frame_chart(evaluation: EvaluationRecord | None, key: str) -> Chart | None:
    """Held-out PSNR per frame of the model and of the interpolating baselines; None without frames."""
    lines = frame_lines(evaluation, key)
    if not lines:
        return None
    return Chart("Held-out PSNR by frame, tissue, dB", lambda axes, theme: _draw_frames(axes, theme, lines), "frame")


def frame_lines(evaluation: EvaluationRecord | None, key: str) -> list[tuple[str, NDArray, NDArray]]:
    """(name, frame numbers, values) of the model and the two interpolating baselines, without null values."""
    baselines = (evaluation or {}).get("baselines") or {}
    sources = [("Model", ((evaluation or {}).get("held_out") or {}).get("per_frame"))]
    for name, label in (("two_neighbours", "Two neighbours"), ("flow_interpolation", "Optical flow")):
        sources.append((label, (baselines.get(name) or {}).get("per_frame")))
    lines = []
    for label, rows in sources:
        pairs = [(row["frame"], row[key]) for row in rows or [] if row.get(key) is not None]
        if pairs:
            table = np.array(pairs, np.float64)
            lines.append((label, table[:, 0], table[:, 1]))
    return lines


def chart_png(chart: Chart, theme: str, dots: int = 220) -> bytes:
    """One chart as a PNG file with a transparent background, 4.4 x 2.75 inches."""
    figure = new_figure(4.4, 2.75, constrained=False)
    figure.subplots_adjust(left=0.13, right=0.93, top=0.97, bottom=0.17)
    draw_chart(figure.add_subplot(), chart, THEMES[theme], title=False)
    return encoded(figure, "png", dots, transparent=True)


def chart_figure(chart: Chart) -> str:
    """A chart as HTML with its title, in a light and a dark version."""
    light, dark = chart_png(chart, "light"), chart_png(chart, "dark")
    return parts.figure(chart.title, parts.themed_image(light, dark, chart.title))


def curves_png(log: LogEntries, evaluation: EvaluationRecord | None = None) -> bytes | None:
    """All charts in one PNG on white, for the run folder; None if there is nothing to draw."""
    found = charts(log, evaluation)
    if not found:
        return None
    rows = (len(found) + 1) // 2
    figure = new_figure(10.4, 3.3 * rows)
    for position, chart in enumerate(found):
        draw_chart(figure.add_subplot(rows, 2, position + 1), chart, LIGHT, title=True)
    return encoded(figure)


def draw_chart(axes: Any, chart: Chart, theme: Theme, title: bool) -> None:
    """Draw a chart with names and legend; above five or more lines, room is left for the legend."""
    chart.draw(axes, theme)
    name_axes(axes, chart.along, title=chart.title if title else "", theme=theme)
    plain_axes(axes, theme)
    if len(axes.lines) > 4:  # no place between the curves is sure to be free
        _leave_room_above(axes, 0.36)
        legend(axes, theme, ncols=2, loc="upper left")
    elif len(axes.get_legend_handles_labels()[1]) > 0:
        legend(axes, theme)


def _leave_room_above(axes: Any, fraction: float) -> None:
    """Raise the upper end of the vertical axis, so that this fraction of the height is above the curves."""
    (low, high), more = axes.get_ylim(), fraction / (1 - fraction)
    axes.set_ylim(top=high * (high / low) ** more if axes.get_yscale() == "log" else high + (high - low) * more)


def _curve(axes: Any, log: LogEntries, key: str, colour: str, label: str, raw: bool = True, dashes: str = "-") -> None:
    iterations, values = series(log, key)
    if not values.size:
        return
    window = max(1, values.size // 60)
    if raw and window > 1:
        axes.plot(iterations, values, color=colour, linewidth=0.5, alpha=0.25)
    axes.plot(iterations, smoothed(values, window), dashes, color=colour, linewidth=1.6, label=label)


def _draw_loss(axes: Any, theme: Theme, log: LogEntries) -> None:
    _curve(axes, log, "loss", theme.colours[0], "")
    _log_scale(axes, log, ("loss",))


def _draw_terms(axes: Any, theme: Theme, log: LogEntries) -> None:
    for position, key in enumerate(TERMS):
        if positive := _positive(log, key):
            label = "1 − ssim" if key == "ssim" else key
            again, colour = divmod(position, len(theme.colours))  # more terms than colours: the others are dashed
            _curve(axes, positive, key, theme.colours[colour], label, raw=False, dashes="--" if again else "-")
    _log_scale(axes, log, TERMS)


def _positive(log: LogEntries, key: str) -> LogEntries:
    """The entries with a positive minimised value of a term, which they have in its place; a logarithm has no zero."""
    values = [(entry, minimised(entry, key)) for entry in log]
    return [cast(LogEntry, {**entry, key: value}) for entry, value in values if value is not None and value > 0]


def minimised(entry: LogEntry, key: str) -> float | None:
    """The minimised value of a loss term: 1 - SSIM for SSIM, which the log stores unchanged."""
    value = entry.get(key)
    if not isinstance(value, int | float):
        return None
    return 1.0 - value if key == "ssim" else float(value)


def _log_scale(axes: Any, log: LogEntries, keys: tuple[str, ...]) -> None:
    if any((series(log, key)[1] > 0).any() for key in keys):
        from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

        axes.set_yscale("log", nonpositive="mask")
        low, high = axes.get_ylim()
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50 * low else (1.0,)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_psnr(axes: Any, theme: Theme, log: LogEntries, evaluation: EvaluationRecord | None) -> None:
    _curve(axes, log, "psnr", theme.colours[0], "training view")
    levels = (("held_out", "held-out frames, end", "--", 1), ("training", "training frames, end", ":", 2))
    for key, label, dashes, colour in levels:
        measured = (evaluation or {}).get(key)
        value = held_out_means(evaluation, measured)[0].get("psnr_tissue") if evaluation and measured else None
        if value is not None:
            axes.axhline(
                value, color=theme.colours[colour], linestyle=dashes, linewidth=1.4, label=f"{label} {value:.2f}"
            )


def _draw_count(axes: Any, theme: Theme, log: LogEntries) -> None:
    iterations, values = series(log, "gaussians")
    axes.plot(iterations, values, color=theme.colours[0], linewidth=1.6)
    axes.set_ylim(bottom=0)


def _draw_frames(axes: Any, theme: Theme, lines: list[tuple[str, NDArray, NDArray]]) -> None:
    for position, (label, frames, values) in enumerate(lines):
        marker = "o" if position == 0 else "s"
        axes.plot(
            frames, values, marker=marker, markersize=5, linewidth=1.4, color=theme.colours[position], label=label
        )
