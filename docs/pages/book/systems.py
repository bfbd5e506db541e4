"""Table of docs/guides/platforms.md from docs/results/platforms.json: python docs/make.py book.systems

docs/results/platforms.json   python tests/platforms.py --json docs/results/platforms.json
"""

from pathlib import Path
from typing import Any

from pages.store.marks import read_json, write_marked

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "guides" / "platforms.md"
RESULT = ROOT / "docs" / "results" / "platforms.json"
MADE_BY = "python tests/platforms.py --json docs/results/platforms.json"


def parts() -> dict[str, str]:
    """The generated part of the page."""
    return {"resolved": resolved(read_json(RESULT, MADE_BY))}


def resolved(result: dict[str, Any]) -> str:
    """One row per system, one column per version of Python; cells list the versions of Numba, NumPy and OpenCV."""
    rows = result["rows"]
    pythons = list(dict.fromkeys(row["python"] for row in rows))
    heads = ["System", *(f"Python {version}" for version in pythons)]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for system in dict.fromkeys(row["system"] for row in rows):
        cells = [_cell(row) for row in rows if row["system"] == system]
        lines.append(f"| {system} | {' | '.join(cells)} |")
    note = "Versions of Numba, NumPy and OpenCV that are chosen, or a dependency that has no wheel."
    return "\n".join([*lines, "", f"{note} Resolved on {result['date'][:10]}."])


def _cell(row: dict[str, Any]) -> str:
    if not row["complete"]:
        return f"no wheel of {row['lacks']}"
    return ", ".join(row["versions"][name] for name in ("numba", "numpy", "opencv-contrib-python-headless"))


def main(words: list[str]) -> None:
    """Write the part of the page; takes no words."""
    write_marked(PAGE, parts(), "platforms")
