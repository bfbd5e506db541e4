"""Ports that hold a certificate: the table of docs/guides/port.md, by

    python docs/make.py ports.certified

Every file of docs/results/certificates is a certificate that `endotsr golden run --certificate` wrote. A file that is
not one, or whose claim is not that of its numbers, is refused.
"""

from collections.abc import Sequence
from pathlib import Path

from endotsr.port.judge.certificate import Certificate, read_certificate
from endotsr.results.report.tables import markdown
from pages.store.marks import write_marked

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "guides" / "port.md"
FOLDER = ROOT / "docs" / "results" / "certificates"


def table(found: Sequence[Certificate]) -> str:
    """One row for each certificate, the highest level first."""
    heads = ("Port", "Claim", "Cases", "Worst output, of its tolerance", "Seconds", "Machine", "Date")
    rows = []
    for one in sorted(found, key=lambda c: (-c.level, c.port.name, c.precision)):
        where = f"{one.machine.processor}, {one.machine.cores} cores"
        numbers = (str(one.cases), f"{100 * one.tolerances.used:.0f} %", f"{one.seconds:.1f}")
        rows.append((one.port.name, one.claim, *numbers, where, one.date[:10]))
    return markdown(heads, rows)


def main(words: list[str]) -> None:
    """Write the part of the page; takes no words."""
    found = [read_certificate(file) for file in sorted(FOLDER.glob("*.json"))]
    write_marked(PAGE, {"table": table(found)}, "certified")
