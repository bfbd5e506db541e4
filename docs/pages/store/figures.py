"""Marks of the figures of all pages, in the style of `endotsr.results.report.style`."""

from collections.abc import Sequence
from typing import Any

from endotsr.results.report.style import GREY

SMALL = 8  # size of letters within an axes


def logarithmic_x(axes: Any, ticks: Sequence[float], **others: Any) -> None:
    """A logarithmic axis of x with these ticks as plain numbers."""
    axes.set(xscale="log", xticks=ticks, xticklabels=[f"{tick:g}" for tick in ticks], **others)
    axes.minorticks_off()


def level(axes: Any, value: float, name: str) -> None:
    """A dashed grey line with its name at the right end."""
    axes.axhline(value, color=GREY, linewidth=1, linestyle="--")
    place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    axes.annotate(name, (1.0, value), xytext=(-4, 2), ha="right", fontsize=SMALL, color=GREY, **place)
