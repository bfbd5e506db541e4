"""The elements of every chapter of the book: equations, motive, derivation, figures, exercises and run time.

    python docs/make.py book.chapters measure [NUMBER ...]   run these notebooks, or all, at their small size
                                                             on one thread, and keep the stored times of the others

The table is in notebooks/index.md. All but the times is read from the text of the notebooks. A test checks every
chapter with `missing`.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from typing import Any, NamedTuple

from endotsr.errors import InputError
from endotsr.untrusted.names import choice, counted
from pages.store.commands import loaded
from pages.store.program import DOCS, Program
from pages.store.tables import noted, where_and_cores

NOTEBOOKS = DOCS.parent / "notebooks"
MEASURES = {"00_why", "16_tradeoff", "17_effects"}
"""Chapters that measure the results of other derivations and have none of their own."""
LEAST_WORDS, EXERCISES, LONGEST = 12, 3, 600.0  # words of a motive; exercises; seconds of all chapters together


class Chapter(NamedTuple):
    """The elements of a notebook."""

    title: str
    equations: str  # that the text before the first section names, as links
    motive: str  # the first sentences before the first section
    steps: int  # numbered steps of a derivation
    derived: bool  # a section on the reverse pass
    figures: int  # shown by matplotlib
    plays: int  # figures that respond to the reader
    exercises: int
    judged: int  # exercises that golden cases judge


def chapter_of(text: str) -> Chapter:
    """The elements of a notebook in the percent format."""
    prose = "\n".join(line.removeprefix("#").removeprefix(" ") for line in text.splitlines() if line.startswith("#"))
    title, _, rest = prose.partition("\n# ")[2].partition("\n")
    opening = re.split(r"\n## |\n%%|\n\$\$", rest)[0].strip()
    sentences = re.split(r"(?<=[.?!])\s+", " ".join(opening.split("\n\n")[0].split()))
    last = prose.partition("\n## Exercise")[2]
    announced = re.findall(r"\{eq\}`eq-[\w-]+`", rest.split("\n## ")[0])
    return Chapter(
        title, " ".join(dict.fromkeys(announced)), " ".join(sentences[:2]),
        len(re.findall(r"^\*\*\(\d+\.\d+\)", prose, re.M)),
        "\n## The reverse pass" in prose, text.count("plt.show()"), text.count("data-widget="),
        len(re.findall(r"^\d\. ", last, re.M)), len(re.findall(r"`--only \w+`", last)),
    )  # fmt: skip


def missing(name: str, chapter: Chapter) -> list[str]:
    """The missing elements of a chapter."""
    wanted = {
        "motive": len(chapter.motive.split()) >= LEAST_WORDS,
        "derivation": name in MEASURES or chapter.derived or chapter.steps > 0,
        "figure": chapter.figures > 0,
        "exercises": chapter.exercises >= EXERCISES and chapter.judged > 0,
    }
    return [element for element, there in wanted.items() if not there]


def chapters() -> dict[str, Chapter]:
    """Every notebook by the stem of its file."""
    return {file.stem: chapter_of(file.read_text(encoding="utf-8")) for file in sorted(NOTEBOOKS.glob("*.py"))}


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Processor time and elapsed time of notebooks, run as scripts on one thread; all of them without numbers.

    Raises: InputError for a number without a notebook, and for a notebook that fails.
    """
    numbers = options.numbers
    files = {file.name[:2]: file for file in sorted(NOTEBOOKS.glob("[0-9]*.py"))}
    if not {*numbers} <= {*files}:
        raise InputError(f"no notebook {sorted({*numbers} - {*files})}; use {choice(files)}")
    environment = os.environ | {"ENDOTSR_NOTEBOOK_SIZE": "small", "MPLBACKEND": "Agg", "NUMBA_NUM_THREADS": "1"}
    found = loaded(options.record)["chapters"] if numbers else {}
    for file in (files[number] for number in numbers or files):
        before, began = os.times(), time.monotonic()
        done = subprocess.run([sys.executable, str(file)], env=environment, capture_output=True, text=True)
        if done.returncode:
            raise InputError(f"{file}: failed: {done.stderr[-500:]}")
        after = os.times()
        spent = after.children_user + after.children_system - before.children_user - before.children_system
        found[file.stem] = {"processor_seconds": spent, "seconds": time.monotonic() - began}
        print(f"{file.stem}: {spent:.0f} s", flush=True)
    return {"chapters": found}


def table(times: dict[str, Any]) -> str:
    """One row per chapter, and the total run time."""
    rows = []
    for name, chapter in chapters().items():
        spent = times["chapters"].get(name, {}).get("processor_seconds")
        steps = f"{chapter.steps} steps" if chapter.steps else "reverse pass" if chapter.derived else "measures only"
        figures = counted(chapter.figures, "figure") + (f", {chapter.plays} interactive" if chapter.plays else "")
        exercises = f"{counted(chapter.exercises, 'exercise')}, {chapter.judged} judged"
        contents = (steps, figures, exercises, "time not measured" if spent is None else f"{spent:.0f} s")
        rows.append([f"{{doc}}`{name}` {chapter.equations}".strip(), chapter.motive, "; ".join(contents)])
    total = sum(row["processor_seconds"] for row in times["chapters"].values())
    about = (
        f"Times are processor time at the small size on one thread, kernels compiled before; {total / 60:.1f} minutes "
        f"together ({where_and_cores(times)}). *Judged*: by golden cases."
    )
    return noted(("Chapter, with its equations", "Motive", "Contents"), rows, about)


PROGRAM = Program(
    __name__, "../notebooks/index.md", {"table": table}, "chapters.json", measured,
    {"numbers": {"nargs": "*", "metavar": "NUMBER"}},
)  # fmt: skip
