"""Chapters in the page: cells, size and seconds of each, in a browser.

    python docs/make.py live measure FOLDER [CHAPTER ...]   open these chapters, or all, in a headless browser with the
                                                            filled FOLDER, and keep the stored rows of the others

The table is in notebooks/index.md. Processor time is that of all processes of the browser.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.untrusted.names import choice
from pages.live.bundle import CHAPTERS, cells, files, formulas
from pages.live.supply import supply
from pages.store.commands import loaded
from pages.store.program import DOCS, Program
from pages.store.tables import noted, where_and_cores

ROOT = DOCS.parent
LONGEST = 900.0  # seconds for one chapter
STATUS = "document.querySelector('.live-bar [role=status]').textContent"
OUTPUTS = "[...document.querySelectorAll('.live-row span')].map((word) => word.textContent)"


def opened(chapter: str, folder: Path, scratch: Path) -> dict[str, Any]:
    """Build the page of a chapter with the folder of Pyodide, press the button, and wait for the last cell.

    Raises: InputError if the page cannot be built, or the chapter does not end.
    """
    environment = os.environ | {"ENDOTSR_DOCS_EXECUTE": "0"}
    words = [sys.executable, "docs/make.py", "book.preview", f"notebooks/{chapter}.py", str(scratch / "book")]
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise InputError(f"{chapter}: the page cannot be built: {done.stderr[-500:]}")
    shutil.copytree(folder, scratch / "book" / "_static" / "pyodide", dirs_exist_ok=True)
    return pressed(scratch / "book" / "notebooks" / f"{chapter}.html", scratch)


def pressed(page: Path, scratch: Path) -> dict[str, Any]:
    """Press the button of a page. Returns: seconds to the first and to the last cell, and the cells that passed."""
    sys.path.insert(0, str(ROOT / "tests" / "results" / "views"))
    from remote import Remote  # type: ignore[import-not-found]

    with Remote(scratch / "profile") as remote:
        remote.open(page, scratch, images=0)
        before, began, found = processor_seconds(remote.process), time.monotonic(), {}
        remote.value("document.querySelector('.live-bar button').click()")
        while "last" not in found:
            spent = {
                "seconds": time.monotonic() - began,
                "processor_seconds": processor_seconds(remote.process) - before,
            }
            status, verdicts = remote.value(STATUS), remote.value(OUTPUTS)
            if "first" not in found and {"passed", "failed"} & {*verdicts}:
                found["first"] = spent
            if "cells ran" in status:
                found["last"] = spent
            if "does not run" in status or spent["seconds"] > LONGEST:
                raise InputError(f"{page.name}: {status}")
            time.sleep(0.1)
        passed = sum(verdict == "passed" for verdict in remote.value(OUTPUTS))
    return found | {"passed": passed, "load": os.getloadavg()[0]}


def processor_seconds(process: int) -> float:
    """Processor time of a process and of those that it has started and that still run."""
    import psutil

    total, parent = 0.0, psutil.Process(process)
    for one in (parent, *parent.children(recursive=True)):
        try:
            times = one.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system
    return total


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The record, with new rows for these chapters.

    Raises: InputError for a name that is no chapter that runs.
    """
    chapters = options.chapters
    if wrong := sorted({*chapters} - {*CHAPTERS}):
        raise InputError(f"{', '.join(wrong)}: runs in no page; use {choice(CHAPTERS)}")
    found = loaded(options.record)["chapters"] if chapters else {}
    for name in chapters or CHAPTERS:
        with tempfile.TemporaryDirectory() as scratch:
            row = opened(name, options.folder, Path(scratch))
        row |= {"cells": len(cells(name)), "formulas": len(formulas(name))}
        found[name] = row | {"bytes": supply().size + sum(map(len, files(name).values()))}
        print(f"{name}: {row['passed']} of {row['cells']} cells, {row['last']['seconds']:.0f} s", flush=True)
    return {"pyodide": supply().version, "chapters": found}


def table(result: dict[str, Any]) -> str:
    """One row per chapter."""
    rows = []
    for name in CHAPTERS:
        row = result["chapters"][name]
        times = [f"{row[key]['processor_seconds']:.0f} s" for key in ("first", "last")]
        times.append(f"{row['first']['seconds']:.0f} s")
        size = f"{row['bytes'] / 1e6:.1f} MB"
        rows.append([f"{{doc}}`{name}`", f"{row['passed']} of {row['cells']}", f"{row['formulas']}", size, *times])
    heads = ("Chapter", "Cells", "Formulas", "Read", "First result", "Last cell", "First, elapsed")
    load = max(row["load"] for row in result["chapters"].values())
    about = (
        "Processor time of a headless browser from the press to the first result and to "
        "the last cell, then elapsed time to the first result, from local files "
        f"(Pyodide {result['pyodide']}, {where_and_cores(result)}). The machine did other work meanwhile: "
        f"up to {load:.0f} processes were waiting or running."
    )
    return noted(heads, rows, about)


PROGRAM = Program(
    __name__, "../notebooks/index.md", {"table": table}, "live.json", measured,
    {"folder": {"type": Path, "metavar": "FOLDER"}, "chapters": {"nargs": "*", "metavar": "CHAPTER"}},
)  # fmt: skip
