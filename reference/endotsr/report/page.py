"""One self-contained HTML page about a run: numbers, baselines, pictures, curves, and how it was made.

The page embeds every picture, needs no script and no other file, follows the reader's light or dark colour scheme and
is readable on a phone. It links to the viewer page beside it, if there is one. `write_report` takes plain data only,
so that any program can write such a page.
"""

from pathlib import Path

from endotsr.report import parts as parts
from endotsr.report.data import FramePictures, FreeTable, ReportData
from endotsr.report.sections import SECTIONS
from endotsr.untrusted.writing import replace_text

__all__ = ["FramePictures", "FreeTable", "ReportData", "report_html", "write_report"]


def write_report(path: Path, data: ReportData) -> None:
    """Write the page to `path`: complete or not at all (an older file stays until the new one is whole).

    Raises   OSError as the file system reports it
    """
    content = report_html(data)
    replace_text(Path(path), content)


def report_html(data: ReportData) -> str:
    """The page as text."""
    body = [make(data) for make in SECTIONS]
    return parts.page(data.title, "\n".join(part for part in body if part))
