"""The common style of all charts, drawn with matplotlib on Agg: colours, sizes, axes, files.

In: a matplotlib figure or axes with curves. Out: the same in this style, or the bytes of a file. Equal data give equal
bytes: files have no date, version or random identifier. matplotlib is imported on first use.
"""

import io
from pathlib import Path
from typing import Any, NamedTuple

from endotsr.untrusted.writing import replace_file


class Theme(NamedTuple):
    """The colours for a light or dark background."""

    ink: str  # text
    grey: str  # reference lines and baselines
    faint: str  # grid
    colours: tuple[str, ...]  # of curves, in order


# The first four are from Okabe and Ito (2008): distinguishable with all common types of colour blindness.
BLUE, ORANGE, GREEN, PINK, OCHRE, GREY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a07c00", "#6b7680"
LIGHT = Theme("#24303a", GREY, "#c9d1d8", (BLUE, ORANGE, GREEN, PINK, OCHRE, GREY))
DARK = Theme("#d7dee4", "#9aa6b0", "#414c55", ("#56b4e9", "#f0894a", "#3fcf9f", "#e3a2c8", "#e6c14a", "#9aa6b0"))
THEMES = {"light": LIGHT, "dark": DARK}
INK, FAINT = LIGHT.ink, LIGHT.faint


class Sizes(NamedTuple):
    """Font sizes, points."""

    title: float
    text: float  # axis labels, tick labels, legends


NORMAL, SMALL = Sizes(11, 9), Sizes(9.5, 8)

DOTS_PER_INCH = 160
METADATA = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}}  # suppressed metadata of matplotlib
HASH_SALT = "endotsr"  # makes the identifiers in an svg file deterministic


def new_figure(width: float, height: float, *, constrained: bool = True) -> Any:
    """A white figure of the given size in inches; needs no display.

    constrained   reserve space for labels automatically; False: the caller sets the margins
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    layout = "constrained" if constrained else None
    figure = Figure(figsize=(width, height), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain_axes(axes: Any, theme: Theme = LIGHT, sizes: Sizes = NORMAL, grid: str = "both") -> None:
    """Style axes: a faint grid below the curves, labels without tick marks, no frame.

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
    """Set axis labels and a left-aligned title; empty ones are left out."""
    if x:
        axes.set_xlabel(x, color=theme.ink, fontsize=sizes.text)
    if y:
        axes.set_ylabel(y, color=theme.ink, fontsize=sizes.text)
    if title:
        axes.set_title(title, color=theme.ink, fontsize=sizes.title, loc="left")


def legend(owner: Any, theme: Theme = LIGHT, sizes: Sizes = NORMAL, **where: Any) -> None:
    """A legend without a frame for axes or a whole figure; `where`: matplotlib's options (loc, ncols)."""
    owner.legend(frameon=False, fontsize=sizes.text, labelcolor=theme.ink, **where)


def encoded(figure: Any, kind: str = "png", dots: int = DOTS_PER_INCH, *, transparent: bool = False) -> bytes:
    """The bytes of a picture file; `kind` is "png" or "svg"."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": HASH_SALT, "svg.fonttype": "path"}):
        figure.savefig(buffer, format=kind, dpi=dots, transparent=transparent, metadata=METADATA[kind])
    return buffer.getvalue()


def save(figure: Any, path: Path) -> None:
    """Write the picture atomically; the extension of `path` selects png or svg."""
    content = encoded(figure, path.suffix.removeprefix(".").lower())
    replace_file(path, lambda temporary: temporary.write_bytes(content))
