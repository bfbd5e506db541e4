"""Run the inputs of `inputs_tried.py` of the tests; write the table of those that were read wrongly before.

    python docs/make.py recordings.inputs_tried measure

docs/results/inputs_before.json says what happened to an input on an earlier revision: it was read wrongly in silence,
refused for a wrong reason, or refused. What happens now is run.
"""

import argparse
import sys
import tempfile
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any

from endotsr.results.report.tables import markdown
from pages.store.marks import read_json
from pages.store.program import DOCS, RESULTS, Program

BEFORE = RESULTS / "inputs_before.json"
LONGEST = 160  # characters of a message


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The outcome of every row of `inputs_tried.py`, run now."""
    sys.path.insert(0, str(DOCS.parent / "tests" / "clips" / "sequences" / "inputs"))
    inputs_tried: Any = import_module("inputs_tried")  # of the tests; this module is `pages.recordings.inputs_tried`
    found = {}
    for row in inputs_tried.ROWS:
        with tempfile.TemporaryDirectory() as scratch:
            one = inputs_tried.tried(row, Path(scratch))
        message = " ".join(one.message.replace("|", "/").replace("<", "").split())
        found[row.kind] = {"outcome": one.outcome, "message": message if one.outcome != "right" else ""}
        print(f"{one.outcome:>18}  {row.kind}", flush=True)
    return {"rows": found}


def table(result: dict[str, Any]) -> str:
    """Before and now, and the number of all inputs by their outcome."""
    parts = []
    for occasion in read_json(BEFORE, "hand")["tables"]:
        rows = []
        for kind, verdict, what in occasion["inputs"]:
            now = result["rows"][kind]
            said = f"`{now['message'][:LONGEST]}`" if now["message"] else ""
            rows.append([kind, f"{verdict}: {what}", now["outcome"], said])
        parts.append(markdown((occasion["title"], "Before", "Now", "Message"), rows))
    counts = Counter(row["outcome"] for row in result["rows"].values())
    total = ", ".join(f"{outcome} {count}" for outcome, count in sorted(counts.items()))
    silent = counts.get("WRONG IN SILENCE", 0)
    return "\n\n".join(
        [*parts, f"All {counts.total()} inputs: {total}; wrong in silence {silent}; {result['date'][:10]}."]
    )


PROGRAM = Program(__name__, "guides/checks.md", {"table": table}, "inputs_tried.json", measured)
