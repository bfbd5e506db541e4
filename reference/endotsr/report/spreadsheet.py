"""Measured numbers as CSV, one row per method and frame or per method and metric, for a spreadsheet or a plot.

In: the dictionary of metrics.json, or the rows of a comparison. Out: the text of a CSV file (RFC 4180, `.` in numbers,
an empty cell for no value). Numbers keep every digit, so that they read back as the same numbers.
"""

import csv
import io
from collections.abc import Iterable
from typing import Any

from endotsr.evaluation.compare import Row
from endotsr.evaluation.records import EvaluationRecord

FRAME = ("frame", "name", "time")
COMPARED = ("method", "metric", "mean", "difference", "low", "high", "frames_better", "frames")


def frames_csv(metrics: EvaluationRecord, label: str) -> str:
    """Every held-out frame of a method and of the baselines beside it.

    metrics   dictionary of metrics.json
    label     name of the method in the first column
    """
    methods = [(label, metrics["held_out"]["per_frame"])]
    methods += [(entry["label"], entry["per_frame"]) for entry in metrics["baselines"].values()]
    names = list(dict.fromkeys(key for _, rows in methods for row in rows for key in row if key not in FRAME))
    body = ([name, *(row.get(key) for key in (*FRAME, *names))] for name, rows in methods for row in rows)
    return csv_text(("method", *FRAME, *names), body)


def comparison_csv(rows: Iterable[Row]) -> str:
    """Every method and metric of a comparison."""
    body = []
    for row in rows:
        d = row.difference
        rest = (None,) * 5 if d is None else (d.mean, d.low, d.high, d.better, d.frames)
        body.append([row.label, row.metric, row.mean, *rest])
    return csv_text(COMPARED, body)


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A head and rows; None is an empty cell, a float is written with every digit."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return out.getvalue()
