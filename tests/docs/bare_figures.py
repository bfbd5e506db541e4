"""Figures with a unit in the prose that nothing computes: python tests/docs/bare_figures.py [FILE ...]

A figure is a number, in digits or in words, followed by a unit of measurement, or a range or list of such numbers. It
has a source if

- it lies in a block that a program writes, between `<!-- NAME:start -->` and `<!-- NAME:end -->`,
- a mark `<!--=KEY-->` follows it: `docs/pages/book/figures.py` substitutes it from a record or from the code, or
- it is part of code or of a formula.

Every other figure is printed as FILE:LINE: FIGURE. Counts ("three times in 24 frames") are no figures, 100 % is none,
and neither is the level of an interval ("a 95 % interval").
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/*.md", "docs/guides/*.md", "docs/specification/*.md", "docs/results/*.md",
         "notebooks/*.md", "notebooks/*.py", "reference/endotsr/**/*.py")  # fmt: skip
# Pages that a program writes as a whole: when the book is built, and `tests/mutation/page.py`.
WRITTEN = ("equations.md", "golden_cases.md", "gradient_checks.md", "definition.md", "discrimination.md")

COMPARED = r"times(?=[ \n](?:as|the|its|more|less|over|slow|fast|small|large|long|short|worse|better|too|far))"
UNITS = rf"dB|ns|us|µs|ms|s|min|h|%|[KMG]i?B|px|fold|{COMPARED}"
SPELT = rf"decibels?|seconds?|minutes?|hours?|per ?cent|percent|pixels?|{COMPARED}"
WORDS = "half an?|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|fifteen|twenty|thirty|a hundred"
DIGITS = r"[-+±]?\d[\d.]*(?:e-?\d+)?(?:(?: \d{3})+)?"
INDENTED = re.compile(r"(?<=\n\n)(?: {4,}[^\n]*\n)+")  # a formula or an example of a docstring
MARKED = "\N{CURRENCY SIGN}"  # stands for a figure that has a mark
JOINED = r"(?:,|[ \n](?:to|and|or))[ \n]"
FIGURE = re.compile(
    rf"(?<![\w.$/-])(?:(?:{DIGITS}{JOINED})*{DIGITS}[ \n]?(?:{UNITS}|{SPELT})|(?:{DIGITS}{JOINED})+{MARKED}"
    rf"|(?:{WORDS})[ \n](?:{SPELT.replace('|pixels?', '')}))(?![\w/])"
)
MARK = re.compile(rf"(?:{DIGITS})(?:[ ]?(?:{UNITS}|{SPELT}))?<!--=[^>]+-->")
NONE = re.compile(r"(?<![\d.])100 %|\d+ % (?:\w+ )?(?:intervals?|confidence)|0 times NaN")
WITHOUT = (  # what is no prose; blanks in its place, so that lines keep their numbers
    re.compile(r"^(?P<fence>```+|~~~+).*?^(?P=fence)", re.MULTILINE | re.DOTALL),
    re.compile(r"<!-- (?P<name>[\w:]+):start\b.*?<!-- (?P=name):end -->", re.DOTALL),
    re.compile(r"\$\$.*?\$\$", re.DOTALL),
    re.compile(r"(?P<ticks>`+)[^`]+(?P=ticks)", re.DOTALL),
    re.compile(r"\$[^$\n]+(?:\n[^$\n]+)?\$"),
    re.compile(r"\]\([^)]*\)"),
    NONE,
)


class Bare(NamedTuple):
    """A figure without a source."""

    file: str
    line: int
    figure: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.figure}"


def blank(found: re.Match[str]) -> str:
    """As many lines and columns, and no word."""
    return re.sub(r"[^\n]", " ", found[0])


def prose(path: Path) -> str:
    """The prose of a page, a notebook or a module, every line in its place."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text
    if path.parent.name == "notebooks":
        return cells(text)
    return INDENTED.sub(blank, ast.get_docstring(ast.parse(text), clean=False) or "")


def cells(text: str) -> str:
    """The Markdown cells of a notebook; every other line is empty."""
    lines, inside = [], False
    for line in text.split("\n"):
        border = line.startswith("# %%")
        inside = "[markdown]" in line if border else inside
        lines.append(line.removeprefix("#").removeprefix(" ") if inside and not border else "")
    return "\n".join(lines)


def bare(text: str, name: str) -> Iterator[Bare]:
    """Every figure of a text without a source."""
    for pattern in WITHOUT:
        text = pattern.sub(blank, text)
    text = MARK.sub(lambda found: MARKED + blank(found)[1:], text)
    for found in FIGURE.finditer(text):
        yield Bare(name, text.count("\n", 0, found.start()) + 1, " ".join(found[0].split()))


def files() -> list[Path]:
    """Every file with prose that is checked."""
    found = {file for pattern in PAGES for file in ROOT.glob(pattern)}
    return sorted(file for file in found if file.name not in WRITTEN)


def bare_of(chosen: list[Path]) -> list[Bare]:
    """The figures without a source of some files."""
    return [one for file in chosen for one in bare(prose(file), file.relative_to(ROOT).as_posix())]


def main(words: list[str]) -> int:
    """The command. Returns: 1 if there is a figure without a source."""
    found = bare_of([Path(word).resolve() for word in words] or files())
    print(*found, sep="\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
