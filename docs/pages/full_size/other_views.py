"""The right camera and the depth of held-out frames: trained scenes beside predictions without a model.

    endotsr prepare endonerf_pulling --out docs/results/sweeps/pulling_pairs --right-late -1
    endotsr sweep docs/results/sweeps/other_views.toml --out DIR
    python docs/make.py full_size.sweeps measure other_views DIR/results.json
    python docs/make.py full_size.other_views measure docs/results/sweeps/pulling_pairs

The first three commands train and store the scenes. The last one measures the predictions on the same frames, and how
far apart the rows of the pairs are, and writes the table. The right pictures of pulling are one frame early; the first
command joins pairs of one moment.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.stereo import PairViews, rows_apart
from endotsr.clips.simulator import SimulatorSettings
from endotsr.config import PAPER
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.depth import held_out_depth
from endotsr.results.evaluation.right_view import right_view
from endotsr.results.report.tables import fixed
from endotsr.training.runs.sources import input_record, load_sequence
from pages.full_size import sweeps
from pages.store.intervals import shown
from pages.store.program import Program
from pages.store.tables import noted, where

MODEL, MOVED = "this model", "left picture moved by the prior depth"
COLUMNS = {  # measurement -> its columns: key, head, decimals
    "right_view": (("held_out_psnr", "Right camera, held-out times, dB", 2),
                   ("training_psnr", "Right camera, training times, dB", 2)),
    "depth": (("mean_absolute", "Error of the held-out depth, mm", 2), ("covered", "of the pixels", 3)),
}  # fmt: skip
Rows = Mapping[str, Mapping[str, Any]]  # by measurement and label: the values of one row


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """The rows without a model on a clip."""
    source = str(options.clip)
    sequence = load_sequence(source, PAPER, SimulatorSettings())
    frame = np.zeros((3, sequence.height, sequence.width), np.float32)
    depth = np.ones(frame.shape[1:], np.float32)  # of no model, and without a hole, which would leave pixels out

    def nothing(index: int, camera: Camera) -> RenderOut:
        return RenderOut(frame, depth, depth)

    found = {
        "right_view": right_view(sequence, source, PAPER.sequence, nothing),
        "depth": held_out_depth(sequence, nothing),
    }
    for name, entry in found.items():
        if "reason" in entry:
            raise InputError(f"{source}: {name}: {entry['reason']}")
        entry["rows"] = [row for row in entry.get("rows", ()) if row["label"] != MODEL]
    hashes = input_record(source, sequence, PAPER, SimulatorSettings()).get("arrays_sha256", {})
    apart = rows_of_pairs(options.clip)
    return {"clip": Path(source).name, "measures": found, "rows_apart": apart, "arrays_sha256": hashes}


def rows_of_pairs(clip: Path) -> float:
    """How far points lie above or below their row in the left view, median in pixels, as `endotsr check` finds it.

    Raises InputError where too few points agree.
    """
    files = list(zip(*(sorted((clip / side).glob("*.png")) for side in ("images", "images_right")), strict=True))
    views = PairViews(len(files))
    for i, pair in enumerate(files):
        views.add(i, *(read_picture(file) for file in pair))
    apart = rows_apart(views.rows)
    if not apart.size:
        raise InputError(f"{clip}: too few points are in both views of the pairs")
    return float(np.median(apart))


def table(record: Mapping[str, Any]) -> str:
    """Scenes with intervals over the seeds, then the predictions. Raises InputError for other frames."""
    runs = [row for row in sweeps.rows_of(sweeps.FOLDER / "other_views.toml") if row["sequence"] == record["clip"]]
    if any(row["arrays_sha256"] != record["arrays_sha256"] for row in runs):
        raise InputError("sweeps/other_views.json and other_views.json: the rows must be of the same frames")
    columns = [(name, *column) for name, all_of in COLUMNS.items() for column in all_of]
    lines = []
    for name in dict.fromkeys(row["configuration"] for row in runs):
        of = [labelled(row["measures"]) for row in runs if row["configuration"] == name]
        values = [[one[part, MODEL][key] for one in of] for part, key, _, _ in columns]
        cells = [shown(found, digits) for found, (*_, digits) in zip(values, columns)]
        lines.append([f"`{name}`", str(len(of)), *cells])
    known = labelled(record["measures"])
    for part, label in known:
        of_part = [(key, digits) if of == part else None for of, key, _, digits in columns]
        cells = ["-" if at is None else fixed(known[part, label].get(at[0]), at[1]) for at in of_part]
        lines.append([label[0].upper() + label[1:], "-", *cells])
    heads = [f"{record['clip']}, every eighth frame held out", "seeds", *(head for *_, head, _ in columns)]
    return noted(heads, lines, f"Scenes: mean with the 95 % interval over the seeds. {where(record)}.")


def labelled(measures: Mapping[str, Any]) -> dict[tuple[str, str], Mapping[str, Any]]:
    """The rows of all measurements by measurement and label."""
    return {(name, row["label"]): row for name in COLUMNS for row in measures[name]["rows"]}


PROGRAM = Program(
    __name__, "results/README.md", {"table": table}, "other_views.json", measure, {"clip": {"type": Path}},
    room="other_views",
)  # fmt: skip
