"""Definitions as text of the chapters: the source of a function, between its formula and its figure.

    python docs/make.py book.definitions    copy the functions named in the notebooks into them again

A Markdown cell of a notebook has a line `<!-- definition: MODULE.FUNCTION -->`, followed by a block of code. The block
is the source of that function, so that the notebook can be read without running it. A test compares the two.
"""

import importlib
import inspect
import re
import sys
from pathlib import Path

NOTEBOOKS = Path(__file__).parents[3] / "notebooks"
BLOCK = re.compile(r"^# <!-- definition: ([\w.]+) -->\n# ```python\n(?:#(?: .*)?\n)*?# ```$", re.MULTILINE)


def source_of(dotted: str) -> str:
    """The source of a function, given as MODULE.FUNCTION."""
    module, _, name = dotted.rpartition(".")
    source = inspect.getsource(getattr(importlib.import_module(module), name))
    return re.sub(r"  # (?:fmt: skip|noqa.*)$", "", source, flags=re.MULTILINE).strip()


def block(dotted: str) -> str:
    """The marker and the block of code, as lines of a Markdown cell."""
    lines = [f"<!-- definition: {dotted} -->", "```python", *source_of(dotted).splitlines(), "```"]
    return "\n".join(f"# {line}".rstrip() for line in lines)


def named(text: str) -> list[str]:
    """The functions that a notebook shows."""
    return [match[1] for match in BLOCK.finditer(text)]


def written(text: str) -> str:
    """The notebook with the present source of every function that it shows."""
    return BLOCK.sub(lambda match: block(match[1]), text)


def main(words: list[str]) -> None:
    """The command."""
    if words:
        sys.exit(__doc__)
    for file in sorted(NOTEBOOKS.glob("*.py")):
        text = file.read_text(encoding="utf-8")
        if (again := written(text)) != text:
            file.write_text(again, encoding="utf-8", newline="\n")
            print(f"{file.name}: written")
