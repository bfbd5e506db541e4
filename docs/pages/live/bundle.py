"""The files of a chapter that runs in its page: the definition, the gradient checker, and the clip of the book.

`files` lists them by their path in the folder in which the chapter runs. Every module of `PLAIN` imports nothing but
the standard library, NumPy and modules of this list; `tests/docs/test_live.py` runs every chapter of `CHAPTERS` on
these files alone.
"""

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
CHAPTERS = (
    "01_dictionary",
    "02_colour_residual",
    "04_deformation",
    "05_motion_and_prior",
    "06_covariance",
    "07_projection",
    "08_harmonics",
    "10_laplacian_pyramid",
)
PACKAGE, HERE, CLIP = ROOT / "reference", Path(__file__).parent, ROOT / "notebooks" / "running_clip"
PLAIN = (
    "endotsr/__init__.py",
    "endotsr/errors.py",
    "endotsr/definition/*.py",
    "endotsr/port/__init__.py",
    "endotsr/port/gradcheck/*.py",
    "endotsr/port/operations/__init__.py",
    "endotsr/port/operations/registry.py",
    "endotsr/port/operations/operation.py",
    "endotsr/port/operations/made_up.py",
    "endotsr/port/operations/spectral.py",
    "endotsr/port/operations/laplacian.py",
    "endotsr/port/operations/deformation.py",
    "endotsr/port/operations/projection.py",
    "endotsr/port/operations/pose.py",
    "endotsr/results/__init__.py",
    "endotsr/results/report/__init__.py",
    "endotsr/results/report/tables.py",
)
LEFT_OUT = {"endotsr/port/gradcheck/command.py", "endotsr/definition/__main__.py"}
CELL = re.compile(r"^# %%(.*)$", re.MULTILINE)


def files(chapter: str) -> dict[str, bytes]:
    """What a chapter needs beside NumPy and Matplotlib, by path."""
    found = {path.relative_to(PACKAGE).as_posix(): path for pattern in PLAIN for path in PACKAGE.glob(pattern)}
    found |= {f"pages/live/{name}.py": HERE / f"{name}.py" for name in ("__init__", "table", "helpers", "cells")}
    found["pages/__init__.py"] = HERE.parent / "__init__.py"
    found["matplotlibrc"] = ROOT / "notebooks" / "matplotlibrc"
    if needs_clip(chapter):
        found |= {f"running_clip/{path.name}": path for path in sorted(CLIP.iterdir()) if path.is_file()}
    return {name: path.read_bytes() for name, path in sorted(found.items()) if name not in LEFT_OUT}


def needs_clip(chapter: str) -> bool:
    """Whether a chapter imports the running clip."""
    return "from running_clip import" in (ROOT / "notebooks" / f"{chapter}.py").read_text(encoding="utf-8")


def cells(chapter: str) -> list[str]:
    """The Python cells of a chapter, in order."""
    text = (ROOT / "notebooks" / f"{chapter}.py").read_text(encoding="utf-8")
    parts = CELL.split(text)
    return [body.strip("\n") for head, body in zip(parts[1::2], parts[2::2]) if "[markdown]" not in head]


def formulas(chapter: str) -> dict[str, str]:
    """The definitions that a chapter prints, by the dotted name of the function."""
    text = (ROOT / "notebooks" / f"{chapter}.py").read_text(encoding="utf-8")
    found = re.findall(r"^# <!-- definition: (\S+) -->\n# ```python\n(.*?)^# ```$", text, re.MULTILINE | re.DOTALL)
    return {name: re.sub("^# ?", "", body, flags=re.MULTILINE) for name, body in found}
