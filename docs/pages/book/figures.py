"""Write the figures of the prose from the records: python docs/make.py book.figures

A number in a sentence that has a record behind it carries a comment with its name:

    flow predicts 39.83 dB<!--=flow.tissue--> on tissue

The text before the comment, number and unit, is replaced by that of `FIGURES`. In the raw file the number stands where
it is read, and a browser does not show the comment. Longer texts lie in blocks (`store.marks`).
"""

import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from endotsr.errors import InputError
from endotsr.untrusted.writing import replace_file
from pages.store.marks import read_json

DOCS = Path(__file__).parents[2]
RESULTS = DOCS / "results"
PAGES = ("../*.md", "*.md", "guides/*.md", "specification/*.md", "results/*.md")
MARK = re.compile(  # a number, its unit if any, and the name of the figure
    r"(?P<number>[-+]?\d[\d.]*)(?P<unit> ?(?:dB|ms|s|minutes|GB|MB|px|%|times)?)<!--=(?P<key>[\w.]+)-->"
)
ANY = re.compile(r"<!--=.*?-->")


class Figure(NamedTuple):
    """The mean of one number of several records."""

    records: str  # pattern of files of docs/results
    path: str  # keys and indices, joined by dots
    form: str
    scale: float = 1.0


PULLING, SHARP = "pulling_paper_seed0.json", "pulling_sharp_seed?.json"
PAPER = "pulling_paper_seed?.json"
ALONE = "clips.endonerf_pulling.every eighth frame.baselines"
FIGURES: dict[str, Figure] = {
    "flow_tissue.tissue": Figure("interpolation.json", f"{ALONE}.flow_interpolation_tissue.psnr_tissue", "{:.2f}"),
    "flow.tissue": Figure(PULLING, "baselines.flow_interpolation.mean.psnr_tissue", "{:.2f}"),
    "blend.tissue": Figure(PULLING, "baselines.two_neighbours.mean.psnr_tissue", "{:.2f}"),
    "flow.full": Figure(PULLING, "baselines.flow_interpolation.mean.psnr_full", "{:.2f}"),
    "sharp.tissue": Figure(SHARP, "held_out.mean.psnr_tissue", "{:.2f}"),
    "paper.tissue": Figure(PAPER, "held_out.mean.psnr_tissue", "{:.2f}"),
    "sharp.full": Figure(SHARP, "held_out.mean.psnr_full", "{:.2f}"),
    "paper.full": Figure(PAPER, "held_out.mean.psnr_full", "{:.2f}"),
}


def value(of: Figure, folder: Path = RESULTS) -> float:
    """The mean over the records. Raises: InputError if there is none, or a key is missing."""
    files = sorted(folder.glob(of.records))
    if not files:
        raise InputError(f"docs/results/{of.records}: no such record")
    return of.scale * float(np.mean([_at(read_json(file, of.records), of.path, file) for file in files]))


def _at(found: Any, path: str, file: Path) -> float:
    """The number at a path, or the mean of the list of numbers there."""
    for key in path.split("."):
        try:
            found = found[int(key)] if isinstance(found, list) else found[key]
        except (KeyError, IndexError, ValueError, TypeError):
            raise InputError(f"{file}: no {path}") from None
    return float(np.mean(found))


@cache
def text(key: str) -> str:
    """A figure as text. Raises: InputError for an unknown name."""
    if key not in FIGURES:
        raise InputError(f"docs/pages/book/figures.py: no figure {key!r}; use one of {', '.join(FIGURES)}")
    return FIGURES[key].form.format(value(FIGURES[key]))


def substituted(page: str, of: Callable[[str], str] = text) -> str:
    """The page with the number before every mark replaced. Raises: InputError for a mark without a number before it."""
    for mark in ANY.finditer(page):
        if not any(found.end() == mark.end() for found in MARK.finditer(page)):
            raise InputError(f"{mark[0]}: no number with its unit stands before this mark")
    return MARK.sub(lambda found: f"{of(found['key'])}{found['unit']}<!--={found['key']}-->", page)


def pages() -> list[Path]:
    """Every page of prose."""
    return sorted({file.resolve() for pattern in PAGES for file in DOCS.glob(pattern)})


def main(words: list[str]) -> None:
    """The command."""
    if words:
        sys.exit(__doc__)
    for page in pages():
        old = page.read_text(encoding="utf-8")
        if (new := substituted(old)) != old:
            replace_file(page, lambda temporary, new=new: temporary.write_text(new, encoding="utf-8"))
            print(page.relative_to(DOCS.parent))
