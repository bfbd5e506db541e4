"""Metrics as text: a comparison of methods for the terminal, and CSV for a spreadsheet or a plot.

In: the dictionary of metrics.json, or the rows of `evaluation.compare.compare`. Out: a table of means and paired
differences; or a CSV file (RFC 4180 but for lines that end with LF alone, `.` in numbers, an empty cell for no value)
with one row per method and frame or per method and metric. Its numbers have all digits and are read back exactly. A
text that a spreadsheet would compute, `=1+1` as the name of a method, has an apostrophe before it.
"""

import csv
import io
from collections.abc import Iterable
from typing import Any

from endotsr.results.evaluation.compare import CONFIDENCE, Row
from endotsr.results.evaluation.records import EvaluationRecord
from endotsr.results.report.run_text import TABLE
from endotsr.results.report.tables import fixed, plain

METRICS = {key: (label, digits) for key, label, digits in TABLE}
FRAME = ("frame", "name", "time")
FORMULA = tuple("=+-@\t\n")  # a spreadsheet computes a text that begins so, also inside quotation marks
COMPARED = ("method", "metric", "mean", "difference", "low", "high", "frames_better", "frames", "extrapolated")


def comparison_table(rows: list[Row]) -> str:
    """A line of means per method, then a line per method and metric with the difference to the first method.

    Extrapolated frames have tables of their own.
    """
    parts = [[row for row in rows if row.extrapolated is which] for which in (False, True)]
    beside = " between training frames" if all(parts) else ""
    heads = (f"mean over the held-out frames{beside}", "mean over the extrapolated frames")
    return "\n\n".join(_part_table(part, head) for part, head in zip(parts, heads) if part)


def _part_table(rows: list[Row], head: str) -> str:
    labels = list(dict.fromkeys(row.label for row in rows))
    metrics = list(dict.fromkeys(row.metric for row in rows))
    found = {(row.label, row.metric): row for row in rows}
    means = plain(
        [head, *(METRICS[m][0] for m in metrics)],
        [[label, *(fixed(found[label, m].mean, METRICS[m][1]) for m in metrics)] for label in labels],
    )
    lines = []
    for row in (found[label, m] for label in labels for m in metrics):
        if d := row.difference:
            name, digits = METRICS[row.metric]
            mean, low, high = (fixed(value, digits, "+") for value in (d.mean, d.low, d.high))
            limits = "-" if d.low is None else f"{low} to {high}"
            lines.append([row.label, name, mean, limits, f"{d.better} of {d.frames} frames"])
    if not lines:
        return means
    paired = plain(["", "metric", "difference", f"{CONFIDENCE:.0%} interval", "better on"], lines, left=(0, 1))
    return f"{means}\n\ndifferences to {labels[0]}, frame by frame\n{paired}"


def frames_csv(metrics: EvaluationRecord, label: str) -> str:
    """CSV of every held-out frame of a method and of the baselines.

    metrics   dictionary of metrics.json
    label     name of the method, for the first column
    """
    methods = [(label, metrics["held_out"]["per_frame"])]
    methods += [(entry["label"], entry["per_frame"]) for entry in metrics["baselines"].values()]
    names = list(dict.fromkeys(key for _, rows in methods for row in rows for key in row if key not in FRAME))
    body = ([name, *(row.get(key) for key in (*FRAME, *names))] for name, rows in methods for row in rows)
    return csv_text(("method", *FRAME, *names), body)


def comparison_csv(rows: Iterable[Row]) -> str:
    """CSV of every method and metric of a comparison."""
    body = []
    for row in rows:
        d = row.difference
        rest = (None,) * 5 if d is None else (d.mean, d.low, d.high, d.better, d.frames)
        body.append([row.label, row.metric, row.mean, *rest, int(row.extrapolated)])
    return csv_text(COMPARED, body)


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A header and rows; None is an empty cell, floats have all digits, no text is a formula."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(map(_cell, row) for row in rows)
    return out.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, str):
        value = value.replace("\r", "\n")  # the writer puts no quotation marks around a lone CR, which ends a row
        return f"'{value}" if value.startswith(FORMULA) else value
    return "" if value is None else value
