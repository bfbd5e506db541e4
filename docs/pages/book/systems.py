"""Table of docs/guides/platforms.md from docs/results/platforms.json.

docs/results/platforms.json   python tests/platforms.py --json docs/results/platforms.json
"""

from typing import Any

from pages.store.program import Program
from pages.store.tables import noted


def resolved(result: dict[str, Any]) -> str:
    """One row per system, one column per version of Python; cells list the versions of Numba, NumPy and OpenCV."""
    rows = result["rows"]
    heads = ["System", *(f"Python {version}" for version in dict.fromkeys(row["python"] for row in rows))]
    systems = dict.fromkeys(row["system"] for row in rows)
    cells = [[system, *(_cell(row) for row in rows if row["system"] == system)] for system in systems]
    note = "Versions of Numba, NumPy and OpenCV that are chosen, or a dependency that has no wheel."
    return noted(heads, cells, f"{note} Resolved on {result['date'][:10]}.")


def _cell(row: dict[str, Any]) -> str:
    if not row["complete"]:
        return f"no wheel of {row['lacks']}"
    return ", ".join(row["versions"][name] for name in ("numba", "numpy", "opencv-contrib-python-headless"))


PROGRAM = Program(__name__, "guides/platforms.md", {"resolved": resolved}, "platforms.json", room="platforms")
