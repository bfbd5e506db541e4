"""Write the figures of the prose from the records: python docs/make.py book.figures

A number in a sentence that has a record behind it carries a comment with its name:

    flow predicts 39.83 dB<!--=flow.tissue--> on tissue

The number before the comment is replaced by that of `figure_table.FIGURES`; the unit stays. In the raw file the number
stands where it is read, and a browser does not show the comment. Longer texts lie in blocks (`store.marks`). A figure
is the mean of one number of records, a constant of the code, or a formula of other figures.

`python tests/docs/bare_figures.py` lists the figures of the prose without such a comment.
"""

import importlib
import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.errors import InputError
from endotsr.untrusted.names import choice
from endotsr.untrusted.writing import replace_file
from pages.book.figure_table import FIGURES, Figure, Formula, Setting
from pages.store.marks import read_json
from pages.store.program import DOCS, RESULTS

PAGES = ("../*.md", "*.md", "guides/*.md", "specification/*.md", "results/*.md", "../notebooks/*.md",
         "../notebooks/*.py")  # fmt: skip
UNITS = "dB|mm|ms|us|s|seconds|min|minutes|hours|[KMG]i?B|px|pixels|%|times"
MARK = re.compile(  # a number, its unit if any, and the name of the figure
    rf"(?P<number>[-+]?\d[\d.]*)(?P<unit>(?: ?(?:{UNITS}))?)<!--=(?P<key>[\w.]+)-->"
)
STAR = re.compile(r"(?P<list>.*?)\.\*(?P<values>[^.]*)\.(?P<rest>.*)")  # the mean over the entries of a list
ANY = re.compile(r"<!--=.*?-->")


def value(of: Figure | Setting | Formula, folder: Path = RESULTS) -> float:
    """The number of a figure. Raises: InputError if it has no record, or a key or a name of the code is missing."""
    if isinstance(of, Formula):
        return of.of(*(value(FIGURES[key], folder) for key in of.keys))
    if isinstance(of, Setting):
        return of.scale * _constant(of.name)
    files = sorted(folder.glob(of.records))
    if not files:
        raise InputError(f"docs/results/{of.records}: no such record")
    return of.scale * float(np.mean([_at(read_json(file, of.records), of.path, file) for file in files]))


def _constant(dotted: str) -> float:
    """The value of MODULE:NAME, where NAME may have attributes and indices joined by dots."""
    module, _, name = dotted.partition(":")
    try:
        found: Any = importlib.import_module(module)
        for key in name.split("."):
            found = found[int(key)] if key.isdigit() else getattr(found, key)
    except (ImportError, AttributeError, IndexError):
        raise InputError(f"docs/pages/book/figure_table.py: the code has no {dotted}") from None
    return float(found)


def _at(found: Any, path: str, file: Path) -> float:
    """The number at a path, or the mean of the list of numbers there."""
    if star := STAR.fullmatch(path):
        chosen = [one for one in _part(found, star["list"], file) if _has(one, star["values"])]
        if not chosen:
            raise InputError(f"{file}: no {path}")
        return float(np.mean([_at(one, star["rest"], file) for one in chosen]))
    return float(np.mean(_part(found, path, file)))


def _part(found: Any, path: str, file: Path) -> Any:
    for key in path.split("."):
        try:
            found = _entry(found, key) if isinstance(found, list) else found[key]
        except (KeyError, IndexError, ValueError, TypeError, AttributeError):
            raise InputError(f"{file}: no {path}") from None
    return found


def _entry(found: list[Any], key: str) -> Any:
    """An entry of a list by its index, or the one whose keys have these values, as in `clip=pulling&seed=0`."""
    if "=" not in key:
        return found[int(key)]
    (only,) = (one for one in found if _has(one, key))
    return only


def _has(entry: Any, values: str) -> bool:
    """Whether the keys of an entry have these values, as in `clip=pulling&seed=0`; "" asks for none."""
    wanted = (one.split("=", 1) for one in values.split("&") if one)
    return all(str(entry.get(name)) == told for name, told in wanted)


@cache
def text(key: str) -> str:
    """A figure as text. Raises: InputError for an unknown name."""
    if key not in FIGURES:
        raise InputError(f"docs/pages/book/figure_table.py: no figure {key!r}; use {choice(FIGURES)}")
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
