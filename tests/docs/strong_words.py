"""Sentences with a strong word, each of which has a verdict: python tests/docs/strong_words.py

*Because, therefore* and *so* state a cause; *only, never, always, cannot, best, every* and *right to* state something
without exception. `strong_words.toml` says for each such sentence of README, the pages, the notebooks and the
docstrings of modules what makes it true. The command prints the sentences without a verdict, as lines for that file.

A sentence is known by the words around the strong word, so that an edit elsewhere in it needs no new verdict. Not
listed are *so that* (a purpose) and *every* before an ordinal or a number (a period).
"""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from bare_figures import ROOT, WITHOUT, WRITTEN, blank, prose

PAGES = ("README.md", "docs/*.md", "docs/guides/*.md", "docs/specification/*.md", "docs/results/*.md",
         "notebooks/*.md", "notebooks/*.py", "reference/endotsr/**/*.py")  # fmt: skip
TABLE = Path(__file__).with_suffix(".toml")
WORDS = r"because|therefore|so|only|never|always|cannot|best|every|right to"
STRONG = re.compile(
    rf"\b(?:{WORDS})\b(?<!\bso(?= that\b))(?<!\bevery(?= (?:\d|\w+th\b|second\b|third\b|hundred\b)))", re.IGNORECASE
)
ENDS = re.compile(r"(?<=[.!?:;|])\s+|\n\s*\n|\n(?=\s*[-*|] |\s*\d+\. )")
AROUND = 3  # words on each side
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


class Strong(NamedTuple):
    """A strong word in its sentence."""

    file: str
    line: int
    key: str  # the words around it
    sentence: str


def files() -> list[Path]:
    """README, the pages, the notebooks and the modules."""
    return sorted(file for pattern in PAGES for file in ROOT.glob(pattern) if file.name not in WRITTEN)


def sentences(text: str) -> Iterator[tuple[int, str]]:
    """Offset and text of every sentence, without code, formulas and generated blocks."""
    for pattern in (*WITHOUT, COMMENT):
        text = pattern.sub(blank, text)
    start = 0
    for end in [*(found.start() for found in ENDS.finditer(text)), len(text)]:
        yield start, text[start:end]
        start = end


def key(words: list[str], at: int) -> str:
    """The words around the strong one."""
    return " ".join(words[max(0, at - AROUND) : at + AROUND + 1])


def strong(text: str, name: str) -> Iterator[Strong]:
    """Every strong word of a text."""
    for start, sentence in sentences(text):
        for found in STRONG.finditer(sentence):
            before = re.findall(r"\w+", sentence[: found.start()])
            words = [word.lower() for word in (*before, *re.findall(r"\w+", sentence[found.start() :]))]
            line = text.count("\n", 0, start + found.start()) + 1
            yield Strong(name, line, key(words, len(before)), " ".join(sentence.split()))


def all_strong() -> list[Strong]:
    """The strong words of every file."""
    return [one for file in files() for one in strong(prose(file), file.relative_to(ROOT).as_posix())]


def known() -> dict[tuple[str, str], str]:
    """The verdict of every listed strong word, by file and words."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))["files"]
    return {(name, words): verdict for name, of in table.items() for verdict, listed in of.items() for words in listed}


def without_verdict() -> list[Strong]:
    """Strong words that no line of the table knows."""
    table = known()
    return [one for one in all_strong() if (one.file, one.key) not in table]


def without_word() -> list[tuple[str, str]]:
    """File and words of the verdicts whose sentence is gone."""
    found = {(one.file, one.key) for one in all_strong()}
    return [one for one in known() if one not in found]


def main() -> int:
    """The command. Returns: 1 if a strong word has no verdict."""
    found = without_verdict()
    for one in found:
        print(f'{one.file}:{one.line}: {one.sentence}\n    [files."{one.file}"]\n    VERDICT = ["{one.key}"]')
    return int(bool(found))


if __name__ == "__main__":
    from endotsr.cli.parts.closed_pipe import until_closed

    sys.exit(until_closed(main))
