"""A comparison of methods as a table on the terminal.

In: the rows of `evaluation.compare.compare`. Out: text: one line per method with its means, then one per method and
metric with the paired difference.
"""

from endotsr.evaluation.compare import CONFIDENCE, Row
from endotsr.report.run_text import TABLE
from endotsr.report.tables import plain

METRICS = {key: (label, digits) for key, label, digits in TABLE}


def comparison_table(rows: list[Row]) -> str:
    """Means of every method, and its differences to the first one."""
    labels = list(dict.fromkeys(row.label for row in rows))
    metrics = list(dict.fromkeys(row.metric for row in rows))
    found = {(row.label, row.metric): row for row in rows}
    means = plain(
        ["mean over the held-out frames", *(METRICS[m][0] for m in metrics)],
        [[label, *(_number(found[label, m].mean, METRICS[m][1]) for m in metrics)] for label in labels],
    )
    lines = [_difference(row) for label in labels for m in metrics if (row := found[label, m]).difference]
    if not lines:
        return means
    head = ["", "metric", "difference", f"{CONFIDENCE:.0%} interval", "better on"]
    paired = plain(head, lines, left=(0, 1))
    return f"{means}\n\ndifferences to {labels[0]}, frame by frame\n{paired}"


def _difference(row: Row) -> list[str]:
    d, (label, digits) = row.difference, METRICS[row.metric]
    assert d is not None
    span = f"{d.low:+.{digits}f} to {d.high:+.{digits}f}"
    return [row.label, label, f"{d.mean:+.{digits}f}", span, f"{d.better} of {d.frames} frames"]


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
