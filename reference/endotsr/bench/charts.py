"""Charts of benchmark results: stacked bars of the stages, and cost against each size.

In: the results of `bench.stages` and `bench.scaling`. Out: a picture file, png or svg. The colours of stages are
defined here, the rest of the style in `endotsr.report.style`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from endotsr.bench.clock import REST, STAGES
from endotsr.report.style import INK, NORMAL, SMALL, legend, name_axes, new_figure, plain_axes, save

# Stages of one kind share a hue: time bases blue, splatting orange to red, losses green, optimiser violet.
COLOURS = {
    "FDM": "#0b6e99",
    "Fourier": "#a9d3e6",
    "projection": "#7f2704",
    "binning": "#b8480f",
    "blend forward": "#e8762c",
    "blend reverse": "#fdb27a",
    "L1 and SSIM": "#3f6d1c",
    "pyramid": "#79ab45",
    "depth and smoothness": "#bfdc9a",
    "Adam": "#8a4fa3",
    "density control": "#cfa9df",
    REST: "#9aa6b0",
}
assert set(COLOURS) == {*STAGES, REST}


def stage_bars(cases: Sequence[Mapping[str, Any]], path: Path) -> None:
    """One stacked bar a case with the stages in their order; the time of the whole iteration is printed at its end."""
    figure = new_figure(9.6, 1.7 + 0.42 * len(cases))
    axes = figure.subplots()
    labels = [_label(case["case"]) for case in cases]
    left = [0.0] * len(cases)
    for name, colour in COLOURS.items():
        widths = [case["stages"][name]["median_ms"] for case in cases]
        axes.barh(labels, widths, left=left, color=colour, label=name, height=0.72, edgecolor="white", linewidth=0.5)
        left = [a + b for a, b in zip(left, widths)]
    longest = max(left, default=0.0)
    for row, (end, case) in enumerate(zip(left, cases)):
        text = f"{case['iteration']['median_ms']:.0f} ms"
        axes.text(end + 0.012 * longest, row, text, va="center", color=INK, fontsize=NORMAL.text)
    axes.set_xlim(0, 1.1 * longest)
    axes.invert_yaxis()
    name_axes(axes, "median time of one training iteration, ms")
    plain_axes(axes, grid="x")
    legend(figure, loc="outside lower center", ncols=5)
    save(figure, path)


CURVE_COLOURS = {
    "iteration": INK,
    "splat": "#b8480f",
    "blending": "#e8762c",
    "binning": "#7f2704",
    "time bases": "#0b6e99",
    "Fourier": "#8a4fa3",
    "losses": "#5b8c2a",
}


def scaling_curves(axes: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """A panel for each size: measured times as points, the fitted power of the upper decade as a line."""
    columns = min(3, len(axes))
    rows = -(-len(axes) // columns)
    figure = new_figure(3.9 * columns, 3.5 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, axis in zip(panels, axes.values()):
        for name, times in axis["median_ms"].items():
            _power(panel, axis["size"], times, name, axis["exponent"][name])
        _logarithmic(panel, axis["size"], len(axis["median_ms"]))
        name_axes(panel, axis["unit"], "ms")
        plain_axes(panel)
        legend(panel, sizes=SMALL, loc="upper left")
    for empty in panels[len(axes) :]:
        empty.set_visible(False)
    save(figure, path)


def _logarithmic(panel: Any, size: Sequence[float], curves: int) -> None:
    """Make both axes logarithmic with few plain labels: the sizes themselves where their range is small."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    panel.set_xscale("log")
    panel.set_yscale("log")
    low, high = panel.get_ylim()
    middle = (low * high) ** 0.5
    low, high = min(low, middle / 4), max(high, middle * 4)  # so that the noise of a flat curve does not fill the panel
    panel.set_ylim(low / 1.2, high * 9.0 ** (curves / 6.0))  # room for the legend above the curves
    if max(size) < 10 * min(size):
        panel.set_xticks(size)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(FuncFormatter(_short))
        axis.set_minor_formatter(NullFormatter())
    panel.minorticks_off()


def _short(value: float, _: object) -> str:
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:.3g}{letter}"
    return f"{value:g}"


def _power(panel: Any, size: Sequence[float], times: Sequence[float], name: str, power: float | None) -> None:
    import numpy as np

    from endotsr.bench.scaling import upper_decade

    colour = CURVE_COLOURS[name]
    label = name if power is None else f"{name}, exponent {power:.2f}"
    panel.plot(size, times, "o", color=colour, markersize=3.5, label=label)
    if power is not None:
        chosen = upper_decade(size)
        x, y = np.array(size)[chosen], np.array(times)[chosen]
        factor = np.exp(np.mean(np.log(y) - power * np.log(x)))
        panel.plot(x, factor * x**power, color=colour, linewidth=1.2)


def _label(case: Mapping[str, Any]) -> str:
    what = case["scene"] or f"{case['gaussians'] / 1000:g}k"
    return f"{what}, {case['precision']}, {case['threads']} thread{'s' if case['threads'] > 1 else ''}"
