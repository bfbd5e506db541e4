"""Measure the proposed masks against true ones, and write the table of docs/guides/masks.md.

    python docs/make.py recordings.masks measure [--data ../shared/data/endonerf_pulling]      a minute or two

For simulated scenes, the pixels covered by an instrument are known, margin included (`gt_masks`). The masks `gt_masks`
of the real clip are polygons drawn by hand with a wide border. The intersection over union is averaged over the frames
with a nonempty true mask; a scene without instruments should give no proposal.
"""

import argparse
from typing import Any

import numpy as np

from endotsr.clips.masks.propose_masks import propose_masks
from endotsr.clips.sequences.clip import Picture
from endotsr.method.kernels.arrays import BoolArray
from pages.recordings.masked_clips import real, simulated
from pages.store.program import DATA, Program
from pages.store.tables import noted, numbers

SIZE = {"width": 320, "height": 256, "frames": 17}
SCENES = ("pulling", "cutting", "smoke", "everything", "moving-camera", "breathing", "still")
QUALITY = (("iou", 2), ("least_iou", 2), ("precision", 2), ("recall", 2))


def of_clip(pictures: list[Picture], truth: list[BoolArray]) -> dict[str, Any]:
    """Mean intersection over union, precision and recall over the frames with an instrument."""
    proposal = propose_masks(pictures)
    about = {"frames": len(pictures), "instruments": bool(np.any(truth)), "found": proposal.found}
    if not proposal.found or not about["instruments"]:
        return about | {"reason": proposal.reason}
    rows = []
    for found, true in zip(proposal.excluded, truth):
        if true.any():
            both = np.count_nonzero(found & true)
            rows.append((both / (found | true).sum(), both / max(np.count_nonzero(found), 1), both / true.sum()))
    mean, least = np.mean(rows, axis=0), min(row[0] for row in rows)
    return about | {"iou": mean[0], "least_iou": least, "precision": mean[1], "recall": mean[2]}


def table(result: dict[str, Any]) -> str:
    """One row per clip."""
    rows = []
    for name, row in result["clips"].items():
        said = "no proposal" if not row["found"] else "false proposal"
        cells = numbers(row, QUALITY) if "iou" in row else [said, "-", "-", "-"]
        rows.append([name, "yes" if row["instruments"] else "no", *cells])
    headings = ["Clip", "instruments", "IoU, mean", "IoU, worst frame", "precision", "recall"]
    about = f"Simulated scenes: {SIZE['frames']} frames of {SIZE['width']}x{SIZE['height']}. {result['date'][:10]}."
    return noted(headings, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every scene, and the real clip if it is at hand."""
    clips = {f"simulated, `{name}`": of_clip(*simulated(name, **SIZE)) for name in SCENES}
    if options.data.is_dir():
        clips[f"`{options.data.name}`"] = of_clip(*real(options.data))
    return {"clips": clips}


PROGRAM = Program(
    __name__, "guides/masks.md", {"iou": table}, "masks.json", measured, {"--data": DATA / "endonerf_pulling"}
)
