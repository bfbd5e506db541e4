"""Every figure of the prose by the name that its mark has: `39.83 dB<!--=flow.tissue-->`, see `figures`."""

from collections.abc import Callable
from typing import NamedTuple


class Figure(NamedTuple):
    """The mean of one number of several records."""

    records: str  # pattern of files of docs/results
    path: str  # keys and indices, joined by dots
    form: str
    scale: float = 1.0


class Setting(NamedTuple):
    """A constant of the code."""

    name: str  # MODULE:NAME, with attributes and indices joined by dots
    form: str = "{:.0f}"
    scale: float = 1.0


class Formula(NamedTuple):
    """A function of other figures."""

    of: Callable[..., float]
    keys: tuple[str, ...]
    form: str


PULLING, SHARP = "pulling_paper_seed0.json", "pulling_sharp_seed?.json"
PAPER = "pulling_paper_seed?.json"
ALONE = "clips.endonerf_pulling.every eighth frame.baselines"
FIGURES: dict[str, Figure | Setting | Formula] = {
    "flow_tissue.tissue": Figure("interpolation.json", f"{ALONE}.flow_interpolation_tissue.psnr_tissue", "{:.2f}"),
    "flow.tissue": Figure(PULLING, "baselines.flow_interpolation.mean.psnr_tissue", "{:.2f}"),
    "blend.tissue": Figure(PULLING, "baselines.two_neighbours.mean.psnr_tissue", "{:.2f}"),
    "flow.full": Figure(PULLING, "baselines.flow_interpolation.mean.psnr_full", "{:.2f}"),
    "sharp.tissue": Figure(SHARP, "held_out.mean.psnr_tissue", "{:.2f}"),
    "paper.tissue": Figure(PAPER, "held_out.mean.psnr_tissue", "{:.2f}"),
    "sharp.full": Figure(SHARP, "held_out.mean.psnr_full", "{:.2f}"),
    "paper.full": Figure(PAPER, "held_out.mean.psnr_full", "{:.2f}"),
}
