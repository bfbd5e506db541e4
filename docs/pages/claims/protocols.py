"""Rows of docs/claims.md that the paper does not contain: other held-out frames, the right camera, single components.

Those on other frames come from ablations at half size (`ablation_pulling_half*.json`), paired by seed: the whole method
minus the base, and at a fixed count the whole method minus the method without the detail loss.
`endotsr evaluate --measures right_view` measures the right camera on two sets of frames: held-out frames, with a new
time and view, and training frames, with only a new view. Its runs are those of `ablation_pulling_pairs.json`, on the
clip that `endotsr prepare --right-late -1` writes: `check` finds the right pictures of the source one frame early.
"""

from typing import Any

import numpy as np

from endotsr.clips.sequences.splits import split_frames
from endotsr.config import PAPER
from endotsr.results.report.tables import markdown
from endotsr.studies.sweeps.ablation import COMPARISONS, FIXED, NO_PRIOR, Contrast, paired
from endotsr.studies.sweeps.execute import FINISHED
from pages.claims.estimates import SPLIT, Estimate, contrast
from pages.claims.power import least_size
from pages.claims.rules import LEAST_PAIRS, few, without_published
from pages.claims.verdicts import CLIPS, FULL, METRICS, between
from pages.store.intervals import interval, student

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
RIGHT_EYE = ("held_out_psnr", "training_psnr")  # metrics of the right camera
SINGLE = (  # statement, coefficients, with a common spread of the configurations
    ("A against S, each alone on the base", {"A": 1, "S": -1}),
    ("A alone improves on the base", {"A": 1, "base": -1}),
    ("L alone improves on the base", {"L": 1, "base": -1}),
    ("The Matérn prior with a free number of Gaussians", {"S": 1, NO_PRIOR: -1}),
)
MOVED = "left picture moved by the prior depth"  # needs no model, and no other frame
FRAMES = 63  # of pulling
UNMEASURED = ["not measured", "-", "-", "-"]
HEADS = ("ours", "compared", "verdict", "mean", "95 % interval", "detectable with 80 % power")


def ours(found: dict[str, Record | None], half: list[Record | None], pairs: Record | None) -> str:
    """Every row that the paper does not contain.

    half    the ablations at half size
    pairs   that of the clip whose views are of one moment
    """
    rows = [_single_row(found[clip], clip, *one) for clip in CLIPS for one in SINGLE]
    rows += protocol_rows(half, pairs)
    rows += [_motion_row(found[clip], clip) for clip in CLIPS]
    return markdown(HEADS, rows)


def _single_row(found: Record | None, clip: str, says: str, terms: dict[str, int]) -> list[str]:
    first, second = terms
    claim = [f"{says}, {clip}", f"{first} - {second}"]
    estimate = contrast(found, terms, "psnr_full")
    if estimate is None:
        return [*claim, *UNMEASURED]
    form = METRICS["psnr_full"].signed
    verdict = without_published(estimate.paired, len(estimate.values))
    return [*claim, verdict, form.format(estimate.mean), between(estimate.paired, form), _resolved(estimate)]


def _resolved(of: Estimate) -> str:
    """The smallest true difference that the seeds of this row distinguish from 0."""
    count = len(of.values)
    return "-" if count < 2 else f"{least_size(count) * float(np.std(of.values, ddof=1)):.2f} dB"


def _motion_row(found: Record | None, clip: str) -> list[str]:
    """Whether the motion improves times between frames."""
    claim = [f"Between the frames the motion is better than a cross-fade of the model's own renders, {clip}",
             f"{FULL} - cross-fade, tissue"]  # fmt: skip
    rows = [] if found is None else [r for r in found["rows"] if (r["configuration"], r["split"]) == (FULL, SPLIT)]
    values = [
        r["psnr_tissue"] - r["cross_fade_psnr_tissue"] for r in rows
        if r.get("psnr_tissue") is not None and r.get("cross_fade_psnr_tissue") is not None
    ]  # fmt: skip
    if not values:
        return [*claim, *UNMEASURED]
    mean, limits = student(values)
    verdict = without_published(limits, len(values))
    return [*claim, verdict, f"{mean:+.2f} dB", between(limits, "{:+.2f} dB"), "-"]


def visits(half: list[Record | None]) -> str:
    """Training frames and visits of a frame, for every split of the trainings at half size."""
    lengths = {row["split"]: row["iterations"] for found in half if found is not None for row in found["rows"]}
    shown: dict[int, list[str]] = {}
    for split, of, label in (("every_second", 0, "every second frame"), ("blocks", 2, "blocks of 2"),
                             ("end", 8, "the end"), ("every_eighth", 0, "every eighth frame")):  # fmt: skip
        trained, length = len(split_frames(FRAMES, split, of)[0]), lengths.get(f"{split} {of}" if of else split)
        if length is not None:
            made = f"{length / trained:.0f} visits to each of {trained} frames with {label} held out"
            shown.setdefault(length, []).append(made)
    full = PAPER.training.iterations / len(split_frames(FRAMES, "every_eighth", 0)[0])
    parts = [f"{length} iterations make {'; '.join(texts)}." for length, texts in shown.items()]
    return " ".join([*parts, f"A full run makes {full:.0f} visits to each frame."])


def protocol_rows(half: list[Record | None], pairs: Record | None) -> list[list[str]]:
    """Statement, configurations, verdict, mean, 95 % interval, smallest resolved difference."""
    left = [{**row, "status": FINISHED} for found in half if found is not None for row in found["rows"]]
    right = [] if pairs is None else [with_right_eye(row) for row in pairs["rows"]]
    return [_row(right if protocol[3] in RIGHT_EYE else left, *protocol) for protocol in PROTOCOLS]


def gain_of_the_right_eye(pairs: Record | None) -> str:
    """Mean and interval of the gain on the right camera at held-out times, or ""."""
    label = next(protocol[0] for protocol in PROTOCOLS if protocol[3] == RIGHT_EYE[0])
    _, _, verdict, mean, limits, _ = next(row for row in protocol_rows([], pairs) if row[0] == label)
    if pairs is None or verdict == UNMEASURED[0]:
        return ""
    row = pairs["rows"][0]
    return f"{mean} (95 % interval {limits}; {row['width']}x{row['height']}, {row['iterations']} iterations)"


def with_right_eye(row: Record) -> Record:
    """A row with the PSNR of the right camera among its metrics, if measured."""
    measured = row.get("measures", {}).get("right_view", {}).get("rows", [])
    model = next((found for found in measured if found["label"] == "this model"), {})
    return {**row, "status": FINISHED, **{key: model.get(key) for key in RIGHT_EYE}}


def _row(rows: list[Record], label: str, of: Contrast, split: str, metric: str) -> list[str]:
    found = _differences(rows, of, split, metric)
    claim = [label, f"{of.with_} - {of.without}{_about(rows, split)}"]
    if not found:
        return [*claim, *UNMEASURED]
    if len(found) < LEAST_PAIRS:
        return [*claim, few(len(found)), f"{np.mean(found):+.2f} dB", "-", "-"]
    mean, half_width = interval(found)
    low, high = mean - half_width, mean + half_width
    least = least_size(len(found)) * float(np.std(found, ddof=1))
    shown = f"{round(mean, 2) + 0.0:+.2f} dB"  # no "-0.00"
    verdict = without_published((low, high), len(found))
    return [*claim, verdict, shown, f"{low:+.2f} to {high:+.2f} dB", f"{least:.2f} dB"]


def _differences(rows: list[Record], of: Contrast, split: str, metric: str) -> list[float]:
    return [pair.difference for pair in paired(rows, of, split, metric, unrecorded=True)]


def right_eye(pairs: Record | None) -> str:
    """PSNR in the right camera at training times: both configurations, and the left picture moved by the depth."""
    measured = [] if pairs is None else [row for row in pairs["rows"] if "right_view" in row.get("measures", {})]
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


def _about(rows: list[Record], split: str) -> str:
    """Size and length of the runs on a split."""
    of = next((row for row in rows if row["split"] == split), None)
    return "" if of is None else f", {of['width']}x{of['height']}, {of['iterations']} iterations"
