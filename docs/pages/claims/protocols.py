"""Rows of docs/claims.md on other held-out frames, the right camera and a fixed count, where nothing is published.

They come from ablations at half size (`ablation_pulling_half*.json`), paired by seed: the whole method minus the base,
and at a fixed count the whole method minus the method without the detail loss.
`endotsr evaluate --measures right_view` measures the right camera on two sets of frames: held-out frames, with a new
time and view, and training frames, with only a new view.
"""

from typing import Any

import numpy as np

from endotsr.studies.sweeps.ablation import COMPARISONS, FIXED, Contrast, paired
from endotsr.studies.sweeps.execute import FINISHED
from pages.claims.power import least_size
from pages.store.intervals import interval

Record = Any  # content of a file of docs/results
WHOLE = next(c for c in COMPARISONS if c.claim == "all three")  # the whole method against the base
DETAIL = Contrast("L added to A and S, fixed count", f"A+S+L{FIXED}", f"A+S{FIXED}")
PROTOCOLS = (  # what is held out, comparison, split, metric
    ("Laplacian detail improves with a fixed number of Gaussians", DETAIL, "every_eighth", "psnr_full"),
    ("Every second frame held out", WHOLE, "every_second", "psnr_full"),
    ("The view of the right eye, at held-out times", WHOLE, "every_second", "held_out_psnr"),
    ("The view of the right eye, at training times", WHOLE, "every_second", "training_psnr"),
    ("Blocks of 2 frames held out", WHOLE, "blocks 2", "psnr_full"),
    ("The end of the clip held out", WHOLE, "end 8", "psnr_full"),
)
MOVED = "left picture moved by the prior depth"  # needs no model, and no other frame
LEAST_PAIRS = 3  # with fewer, no verdict
UNMEASURED = ["not at hand", "not measured", "-", "-", "-"]


def protocol_rows(half: list[Record | None]) -> list[list[str]]:
    """Claim, configurations, published value, verdict, mean, 95 % interval, smallest resolved difference."""
    rows = [with_right_eye(row) for found in half if found is not None for row in found["rows"]]
    return [_row(rows, *protocol) for protocol in PROTOCOLS]


def with_right_eye(row: Record) -> Record:
    """A row with the PSNR of the right camera among its metrics, if measured."""
    measured = row.get("measures", {}).get("right_view", {}).get("rows", [])
    model = next((found for found in measured if found["label"] == "this model"), {})
    return {**row, "status": FINISHED, **{key: model.get(key) for key in ("held_out_psnr", "training_psnr")}}


def _row(rows: list[Record], label: str, of: Contrast, split: str, metric: str) -> list[str]:
    found = _differences(rows, of, split, metric)
    claim = [label, f"{of.with_} - {of.without}{_about(rows, split)}"]
    if not found:
        return [*claim, *UNMEASURED]
    if len(found) < LEAST_PAIRS:
        few = f"not decided: {len(found)} of {LEAST_PAIRS} seeds"
        return [*claim, "not at hand", few, f"{np.mean(found):+.2f} dB", "-", "-"]
    mean, half_width = interval(found)
    low, high = mean - half_width, mean + half_width
    least = least_size(len(found)) * float(np.std(found, ddof=1))
    shown = f"{round(mean, 2) + 0.0:+.2f} dB"  # no "-0.00"
    return [*claim, "not at hand", decided(low, high), shown, f"{low:+.2f} to {high:+.2f} dB", f"{least:.2f} dB"]


def _differences(rows: list[Record], of: Contrast, split: str, metric: str) -> list[float]:
    return [pair.difference for pair in paired(rows, of, split, metric)]


def right_eye(half: Record | None) -> str:
    """PSNR in the right camera at training times: both configurations, and the left picture moved by the depth."""
    measured = [] if half is None else [row for row in half["rows"] if "right_view" in row.get("measures", {})]
    if not measured:
        return "The right camera is not measured yet."
    rows = [with_right_eye(row) for row in measured]
    means = {
        name: np.mean([row["training_psnr"] for row in rows if row["configuration"] == name])
        for name in (WHOLE.without, WHOLE.with_)
    }
    labels = {row["label"]: row["training_psnr"] for row in measured[0]["measures"]["right_view"]["rows"]}
    models = ", ".join(f"`{name}` {mean:.2f} dB" for name, mean in means.items())
    return f"Right camera at training times: {models}, {MOVED} {labels[MOVED]:.2f} dB."


def decided(low: float, high: float) -> str:
    """The verdict without a published value, from the ends of the interval."""
    return "gains" if low > 0 else "loses" if high < 0 else "not decided: the interval contains 0"


def _about(rows: list[Record], split: str) -> str:
    """Size and length of the runs on a split."""
    of = next((row for row in rows if row["split"] == split), None)
    return "" if of is None else f", {of['width']}x{of['height']}, {of['iterations']} iterations"
