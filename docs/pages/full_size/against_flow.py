"""A run compared with optical flow between the frames, by held-out frame and by kind of pixel.

    python docs/make.py full_size.against_flow measure RUN

The squared error of the tissue pixels is divided among kinds of pixels; a pixel belongs to the first kind that applies.
The tables are written to docs/results/README.md.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import endotsr
from endotsr.api import Run
from endotsr.clips.flow.between import flows_between
from endotsr.clips.sequences.sequence import Sequence
from endotsr.results.evaluation.baselines import flow_interpolation, neighbours, unit_image
from endotsr.results.report.tables import markdown
from pages.store.program import RUN, Program

BRIGHT = 250  # of 255: the largest channel of a highlight, in the frame or in a neighbour
NEAR = 8  # px from an excluded pixel or from the border of the picture
STEEP = 0.9  # quantile of the gradient over the tissue of a frame
KINDS = {
    "excluded": "excluded in a neighbouring training frame",
    "highlight": "highlights, here or in a neighbouring frame",
    "mask": f"within {NEAR} px of an excluded pixel",
    "border": f"within {NEAR} px of the border of the picture",
    "steep": "the steepest tenth of the tissue",
    "plain": "all other pixels",
}


def kinds(sequence: Sequence, index: int) -> dict[str, NDArray[np.bool_]]:
    """Disjoint masks (H, W) of the tissue pixels of a frame, in the order of `KINDS`."""
    import cv2

    near, tissue = neighbours(sequence, index), sequence.masks[index]
    frames = sequence.images[[index, near.before, near.after]]
    found = {"excluded": ~(sequence.masks[near.before] & sequence.masks[near.after])}
    found["highlight"] = (frames.max(axis=1) >= BRIGHT).any(axis=0)
    apart = cv2.distanceTransform(tissue.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    found["mask"] = apart <= NEAR
    inner = np.zeros_like(tissue)
    inner[NEAR:-NEAR, NEAR:-NEAR] = True
    found["border"] = ~inner
    grey = cv2.GaussianBlur(sequence.images[index].mean(axis=0, dtype=np.float32), (0, 0), 1.0)
    slope = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    found["steep"] = slope >= np.quantile(slope[tissue], STEEP)
    found["plain"] = np.ones_like(tissue)
    left, out = tissue.copy(), {}
    for name in KINDS:
        out[name] = left & found[name]
        left = left & ~found[name]
    return out


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Sums of squared errors of model and flow, by frame and by kind of pixel."""
    finished = endotsr.open_run(options.run)
    assert isinstance(finished, Run), f"{options.run}: trained in windows"
    sequence = finished.sequence
    frames, total = [], {name: np.zeros(3) for name in KINDS}
    for index in (int(i) for i in sequence.test_index):
        truth, colour = unit_image(sequence, index), finished.render(float(sequence.times[index]), index).colour
        errors = [
            np.square(np.clip(picture, 0, 1) - truth).mean(axis=0, dtype=np.float64)
            for picture in (colour, flow_interpolation(sequence, index))
        ]
        for name, mask in kinds(sequence, index).items():
            total[name] += [mask.sum(), *(error[mask].sum() for error in errors)]
        frames.append(_frame(sequence, index, errors))
    columns = ("pixels", "model", "flow")
    pixels = {name: dict(zip(columns, map(float, sums), strict=True)) for name, sums in total.items()}
    clip = Path(finished.record["input"]["source"]).name
    return {"sequence": clip, "frames": frames, "pixels": pixels}


def _frame(sequence: Sequence, index: int, errors: list[NDArray[np.floating]]) -> dict[str, Any]:
    """PSNR over the tissue of one frame, and the motion of the tissue between its neighbours."""
    near, tissue = neighbours(sequence, index), sequence.masks[index]
    flow = flows_between(sequence, near.before, near.after).forward
    model, other = (float(-10 * np.log10(error[tissue].mean())) for error in errors)
    moved = float(np.hypot(*flow)[tissue].mean())
    return {"frame": index, "motion_px": moved, "model": model, "flow": other}


def tables(result: dict[str, Any]) -> str:
    """Both tables, frames sorted by their motion."""
    values = ("motion_px", "model", "flow")
    frames = sorted(result["frames"], key=lambda row: row["motion_px"])
    by_frame = [
        [str(row["frame"]), *(f"{row[key]:.2f}" for key in values), f"{row['model'] - row['flow']:+.2f}"]
        for row in frames
    ]
    sums = {key: sum(row[key] for row in result["pixels"].values()) for key in ("pixels", "model", "flow")}
    by_kind = []
    for name, row in result["pixels"].items():
        if not row["pixels"]:
            continue
        more = (row["model"] - row["flow"]) / sums["flow"]
        share = [f"{row[key] / sums[key]:.1%}".replace("%", " %") for key in ("pixels", "model", "flow")]
        by_kind.append([KINDS[name], *share, f"{more:+.1%}".replace("%", " %")])
    seen = [row for name, row in result["pixels"].items() if name != "excluded"]
    ratio = sum(row["model"] for row in seen) / sum(row["flow"] for row in seen) - 1
    head = ["Frame", "motion between its neighbours, px", "model, dB", "flow, dB", "difference, dB"]
    other = ["Tissue pixels", "of the pixels", "of the model's error", "of the error of flow", "model minus flow"]
    return (
        markdown(head, by_frame) + "\n\n" + markdown(other, by_kind) + "\n\n"
        "One run; PSNR over the tissue. A pixel belongs to the first kind that applies. *Model minus flow* is the "
        "difference of the squared errors as a fraction of the whole squared error of flow. On the pixels that no "
        "neighbour excludes, the squared error of the model is "
        f"{100 * abs(ratio):.1f} % {'below' if ratio < 0 else 'above'} that of flow. {result['sequence']}, "
        f"{result['date'][:10]}."
    )


PROGRAM = Program(__name__, "results/README.md", {"table": tables}, "against_flow.json", measured, {"run": RUN})
