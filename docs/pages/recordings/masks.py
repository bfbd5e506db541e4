"""Measure the proposed masks against true ones, and write the table of docs/guides/prepare.md.

    python docs/make.py recordings.masks [--data ../shared/data/endonerf_pulling]      measure, a minute or two
    python docs/make.py recordings.masks --table  rewrite the table of the last result

For simulated scenes, the pixels covered by an instrument are known, margin included (`gt_masks`). The masks `gt_masks`
of the real clip are polygons drawn by hand with a wide border. The intersection over union is averaged over the frames
with a nonempty true mask; a scene without instruments should give no proposal. The result is docs/results/masks.json.
"""

import argparse
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv import read_png
from endotsr.clips.sequences.clip import Picture
from endotsr.clips.sequences.propose_masks import propose_masks
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import with_settings
from endotsr.method.kernels.arrays import BoolArray
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "masks.json", DOCS / "guides" / "prepare.md"
SIZE = {"width": 320, "height": 256, "frames": 17}
SCENES = ("pulling", "cutting", "smoke", "everything", "moving-camera", "breathing", "still")


def simulated(name: str) -> tuple[list[Picture], list[BoolArray]]:
    """Pictures (H, W, 3) and true masks of a scene; a moving camera gets an instrument."""
    changes = {"instrument": {"on": True}} if name == "moving-camera" else {}
    settings = with_settings(named_scene(name), **SIZE, **changes)
    frames = list(simulated_frames(make_scene(settings)))
    return [frame.image.transpose(1, 2, 0) for frame in frames], [frame.excluded for frame in frames]


def real(folder: Path) -> tuple[list[Picture], list[BoolArray]]:
    """Pictures and `gt_masks` of a folder in the layout of EndoNeRF."""
    files = [sorted((folder / name).iterdir()) for name in ("images", "gt_masks")]
    return [read_png(file) for file in files[0]], [read_png(file) > 0 for file in files[1]]


def measured(pictures: list[Picture], truth: list[BoolArray]) -> dict[str, Any]:
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
        numbers = [f"{row[key]:.2f}" for key in ("iou", "least_iou", "precision", "recall")] if "iou" in row else []
        said = "no proposal" if not row["found"] else "false proposal"
        rows.append([name, "yes" if row["instruments"] else "no", *(numbers or [said, "-", "-", "-"])])
    headings = ["Clip", "instruments", "IoU, mean", "IoU, worst frame", "precision", "recall"]
    about = f"Simulated scenes: {SIZE['frames']} frames of {SIZE['width']}x{SIZE['height']}. {result['date']}."
    return markdown(headings, rows) + "\n\n" + about


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--data", type=Path, default=DOCS.parents[1] / "shared" / "data" / "endonerf_pulling")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args(words)
    if not options.table:
        clips = {f"simulated, `{name}`": measured(*simulated(name)) for name in SCENES}
        if options.data.is_dir():
            clips[f"`{options.data.name}`"] = measured(*real(options.data))
        write_json(FILE, {"date": date.today().isoformat(), "clips": clips})
    write_marked(PAGE, {"iou": table(read_json(FILE, "python docs/make.py recordings.masks"))}, "masks")
