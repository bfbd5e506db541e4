"""One self-contained HTML page about a run: numbers, baselines, pictures, curves, and how it was made.

The page embeds every picture, needs no script and no other file, follows the reader's light or dark colour scheme and
is readable on a phone. `write_report` takes plain data only, so that any program that has the numbers can write one.
"""

import os
import tempfile
from pathlib import Path

from endotsr.errors import InputError
from endotsr.evaluation import report_parts as parts
from endotsr.evaluation.report_data import FramePictures, FreeTable, ReportData
from endotsr.evaluation.report_sections import SECTIONS

__all__ = ["FramePictures", "FreeTable", "ReportData", "report_html", "write_report"]


def write_report(path: Path, data: ReportData) -> None:
    """Write the page to `path`: complete or not at all (an older file stays until the new one is whole).

    Raises   InputError naming the file if it cannot be written (no such folder, no right, disk full)
    """
    path = Path(path)
    content = report_html(data).encode("utf-8")
    scratch = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            scratch = Path(file.name)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        scratch.chmod(0o644)
        scratch.replace(path)
    except OSError as error:
        if scratch is not None:
            scratch.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def report_html(data: ReportData) -> str:
    """The page as text."""
    body = [make(data) for make in SECTIONS]
    return parts.page(data.title, "\n".join(part for part in body if part))
