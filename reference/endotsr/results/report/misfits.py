"""Training frames that the model fits much worse than the others, found in the log of a training.

A frame with a wrong prior depth, a mask that shows an instrument, or another exposure can keep a large value of one
term until the end. In: the entries of the log. Out: frames, terms and ratios, and a table of them for the report.

The views of a run between two training frames count for the nearer one, as in the log.
"""

from collections import defaultdict
from typing import NamedTuple

import numpy as np

from endotsr.results.report import parts
from endotsr.results.report.curves import minimised
from endotsr.results.report.tables import html_table
from endotsr.training.fitting.records import LogEntry

LATE = 0.5  # fraction of the training that is not looked at: the fit is still rough
WORSE = 3.0  # times the median over the frames
FEWEST = 3  # visits of a frame, and other frames
MOST = 8  # rows of the table
WORDS = {"l1": "colour", "ssim": "structure", "depth": "depth"}
CHECKS = {"l1": "picture and mask", "ssim": "picture and mask", "depth": "prior depth"}


class Misfit(NamedTuple):
    """A training frame with a large value of one term."""

    frame: int  # frame number
    term: str  # key of `WORDS`
    ratio: float  # of the median over its late visits to the median of that over all frames


def misfits(log: list[LogEntry]) -> list[Misfit]:
    """The frames whose term is more than `WORSE` times the usual one in the second half of a training, worst first.

    Edges:   a frame with fewer than `FEWEST` late visits is left out; without three other frames there is no usual
             value, and the list is empty. A term of 0 in most frames has no ratio.
    """
    steps = [entry for entry in log if "frame" in entry]
    begin = LATE * steps[-1]["iteration"] if steps else 0.0
    late = [entry for entry in steps if entry["iteration"] > begin]
    return sorted(
        (found for term in WORDS for found in _of_term(late, term)), key=lambda found: (-found.ratio, found.frame)
    )


def _of_term(late: list[LogEntry], term: str) -> list[Misfit]:
    values: dict[int, list[float]] = defaultdict(list)
    for entry in late:
        if (value := minimised(entry, term)) is not None:
            values[entry["frame"]].append(value)
    medians = {frame: float(np.median(found)) for frame, found in values.items() if len(found) >= FEWEST}
    usual = float(np.median(list(medians.values()))) if len(medians) > FEWEST else 0.0
    if usual <= 0.0:
        return []
    return [Misfit(frame, term, value / usual) for frame, value in medians.items() if value > WORSE * usual]


def misfits_html(log: list[LogEntry]) -> str:
    """The frames as a sentence and a table; "" if there are none."""
    found = misfits(log)
    if not found:
        return ""
    rows = [[parts.cell(one.frame), WORDS[one.term], f"{one.ratio:.1f}", CHECKS[one.term]] for one in found[:MOST]]
    rest = f" The table has the {MOST} largest of {len(found)}." if len(found) > MOST else ""
    sentence = (
        f"In the second half of the training, these frames keep a term more than {WORSE:g} times as large as that of"
        f" the usual frame.{rest}"
    )
    table = html_table(["Training frame", "Term", "Times the median", "Check its"], rows)
    return f'<p class="note">{parts.text(sentence)}</p>{table}'
