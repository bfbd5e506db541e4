"""Charts of benchmark results: stacked bars of the stages, and cost against each size.

In: the results of `endotsr.studies.bench.stages` and `bench_scaling`. Out: a picture file, png or svg, in the colours
and the style of `endotsr.results.report.style`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from endotsr.results.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    NORMAL,
    OCHRE,
    ORANGE,
    PINK,
    SMALL,
    legend,
    name_axes,
    new_figure,
    plain_axes,
    save,
)
from endotsr.studies.bench.clock import REST, STAGES

# The stages in five groups, which five colours can distinguish. The tables list every stage.
GROUPS = {
    "time bases": (("FDM", "Fourier"), BLUE),
    "splatting": (("projection", "binning", "blend forward", "blend reverse"), ORANGE),
    "losses": (("L1 and SSIM", "pyramid", "depth and smoothness"), GREEN),
    "optimiser": (("Adam", "density control"), PINK),
    "rest": ((REST,), GREY),
}
assert {stage for stages, _ in GROUPS.values() for stage in stages} == {*STAGES, REST}


def stage_bars(cases: Sequence[Mapping[str, Any]], path: Path) -> None:
    """One stacked bar per case with the groups of stages, labelled with the time of the whole iteration."""
    figure = new_figure(9.6, 1.7 + 0.42 * len(cases))
    axes = figure.subplots()
    labels = [_label(case["case"]) for case in cases]
    left = [0.0] * len(cases)
    for name, (stages, colour) in GROUPS.items():
        widths = [sum(case["stages"][stage]["median_ms"] for stage in stages) for case in cases]
        axes.barh(labels, widths, left=left, color=colour, label=name, height=0.72, edgecolor="white", linewidth=0.5)
        left = [a + b for a, b in zip(left, widths)]
    longest = max(left, default=0.0)
    for row, (end, case) in enumerate(zip(left, cases)):
        text = f"{case['iteration']['median_ms']:.0f}\u00a0ms"
        axes.text(end + 0.012 * longest, row, text, va="center", color=INK, fontsize=NORMAL.text)
    axes.set_xlim(0, 1.1 * longest)
    axes.invert_yaxis()
    name_axes(axes, "median time of one training iteration, ms")
    plain_axes(axes, grid="x")
    legend(figure, loc="outside lower center", ncols=5)
    save(figure, path)


CURVE_COLOURS = {
    "iteration": INK,
    "splat": ORANGE,
    "blending": OCHRE,
    "binning": GREY,
    "time bases": BLUE,
    "Fourier": PINK,
    "losses": GREEN,
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
    """Make both axes logarithmic with few plain labels: the sizes themselves if their range is small."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    panel.set_xscale("log")
    panel.set_yscale("log")
    low, high = panel.get_ylim()
    middle = (low * high) ** 0.5
    low, high = min(low, middle / 4), max(high, middle * 4)  # the noise of a flat curve must not fill the panel
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

    from pages.bench.scaling import upper_decade

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
