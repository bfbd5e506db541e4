"""Ports that hold a certificate: the table of docs/guides/port.md.

Every file of docs/results/certificates is a certificate that `endotsr golden run --certificate` wrote. A file that is
not one, or whose claim is not that of its numbers, is refused.
"""

from endotsr.port.judge.certificate import read_certificate
from endotsr.results.report.tables import markdown
from pages.store.program import RESULTS, Program

FOLDER = RESULTS / "certificates"


def table() -> str:
    """One row for each certificate, the highest level first."""
    heads = ("Port", "Claim", "Cases", "Worst output, of its tolerance", "Seconds", "Machine", "Date")
    rows, found = [], [read_certificate(file) for file in sorted(FOLDER.glob("*.json"))]
    for one in sorted(found, key=lambda c: (-c.level, c.port.name, c.precision)):
        where = f"{one.machine.processor}, {one.machine.cores} cores"
        numbers = (str(one.cases), f"{100 * one.tolerances.used:.0f} %", f"{one.seconds:.1f}")
        rows.append((one.port.name, one.claim, *numbers, where, one.date[:10]))
    return markdown(heads, rows)


PROGRAM = Program(__name__, "guides/port.md", {"table": table})
