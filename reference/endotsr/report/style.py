"""The one style of every chart, drawn with matplotlib on Agg: colours, sizes, axes, files.

In: a matplotlib figure or axes with curves on it. Out: the same in this style, or the bytes of a file.
Equal numbers give equal bytes: a picture holds no date, no version and no random identifier. This module is independent
of the data drawn. matplotlib is imported when a picture is made, not before.
"""

import io
from pathlib import Path
from typing import Any, NamedTuple

from endotsr.untrusted.writing import replace_file


class Theme(NamedTuple):
    """Colours on one background."""

    ink: str  # words and numbers
    grey: str  # reference lines and baselines
    faint: str  # grid
    colours: tuple[str, ...]  # of curves, in their order


# The first four are of Okabe and Ito (2008), which readers with any common colour blindness tell apart.
BLUE, ORANGE, GREEN, PINK, OCHRE, GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a07c00", "#6b7680"
LIGHT = Theme("#24303a", GREY, "#c9d1d8", (BLUE, ORANGE, GREEN, PINK, OCHRE, GREY))
DARK = Theme("#d7dee4", "#9aa6b0", "#414c55", ("#56b4e9", "#f0894a", "#3fcf9f", "#e3a2c8", "#e6c14a", "#9aa6b0"))
THEMES = {"light": LIGHT, "dark": DARK}
INK, FAINT = LIGHT.ink, LIGHT.faint


class Sizes(NamedTuple):
    """Font sizes, points."""

    title: float
    text: float  # labels of axes, numbers, legends


NORMAL, SMALL = Sizes(11, 9), Sizes(9.5, 8)

DOTS_PER_INCH = 160
METADATA = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}}  # metadata that matplotlib would add
HASH_SALT = "endotsr"  # of the names inside an svg file, instead of a random one


def new_figure(width: float, height: float, *, constrained: bool = True) -> Any:
    """A figure of the given size in inches on white, drawn without a display.

    constrained   the layout reserves space for labels; with False the caller sets the margins
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    layout = "constrained" if constrained else None
    figure = Figure(figsize=(width, height), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain_axes(axes: Any, theme: Theme = LIGHT, sizes: Sizes = NORMAL, grid: str = "both") -> None:
    """A faint grid below the curves, numbers without ticks, no frame.

    grid   "both", "x" or "y": the axes with grid lines
    """
    axes.tick_params(which="both", colors=theme.ink, labelsize=sizes.text, length=0)
    axes.grid(True, axis=grid, color=theme.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    for side in axes.spines.values():
        side.set_visible(False)


def name_axes(
    axes: Any, x: str = "", y: str = "", title: str = "", theme: Theme = LIGHT, sizes: Sizes = NORMAL
) -> None:
    """Names of the axes and a title at the left; an empty one is left out."""
    if x:
        axes.set_xlabel(x, color=theme.ink, fontsize=sizes.text)
    if y:
        axes.set_ylabel(y, color=theme.ink, fontsize=sizes.text)
    if title:
        axes.set_title(title, color=theme.ink, fontsize=sizes.title, loc="left")


def legend(owner: Any, theme: Theme = LIGHT, sizes: Sizes = NORMAL, **where: Any) -> None:
    """A legend without a frame, of axes or of a whole figure; `where` as matplotlib takes it (loc, ncols)."""
    owner.legend(frameon=False, fontsize=sizes.text, labelcolor=theme.ink, **where)


def encoded(figure: Any, kind: str = "png", dots: int = DOTS_PER_INCH, *, transparent: bool = False) -> bytes:
    """The bytes of a picture file; `kind` is "png" or "svg"."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": HASH_SALT, "svg.fonttype": "path"}):
        figure.savefig(buffer, format=kind, dpi=dots, transparent=transparent, metadata=METADATA[kind])
    return buffer.getvalue()


def save(figure: Any, path: Path) -> None:
    """Write the picture, png or svg by the ending of `path`, complete or not at all."""
    content = encoded(figure, path.suffix.removeprefix(".").lower())
    replace_file(path, lambda temporary: temporary.write_bytes(content))
