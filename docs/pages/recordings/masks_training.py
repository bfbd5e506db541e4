"""Train with carried masks and with the given ones, over seeds, and write the table of docs/guides/masks.md.

    python docs/make.py recordings.masks_training measure CLIP ... [--seeds 3]   some minutes a run

A CLIP is a folder in the layout of EndoNeRF. The key frames are evenly spaced, and their masks are those of `gt_masks`.
All runs of a clip are measured on the same pixels of the held-out frames: tissue in the given masks and in the carried
masks of every row. Finished runs are kept, and a stopped command continues.
"""

import argparse
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import endotsr
from endotsr.clips.flow.clip_flows import motion_of
from endotsr.clips.masks.carry_masks import carry_masks
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray
from endotsr.results.evaluation.metrics import psnr_tissue
from pages.store import kept
from pages.store.intervals import shown
from pages.store.program import CLIPS, Program
from pages.store.tables import noted, where

GIVEN, PRESET = "given", "quick"
ROWS = {GIVEN: (0, 0), "8 keys, margin 2": (8, 2), "4 keys, margin 2": (4, 2), "8 keys, margin 0": (8, 0)}
SEEDS = {GIVEN: 3, "8 keys, margin 2": 3, "4 keys, margin 2": 1, "8 keys, margin 0": 1}


@cache
def sequences(folder: str) -> dict[str, Sequence]:
    """The sequence with the masks of every row."""
    given = endotsr.load_sequence(folder, masks="gt_masks")
    motion = motion_of([image.transpose(1, 2, 0) for image in given.images])
    found = {GIVEN: given}
    for name, (count, margin) in ROWS.items():
        if name != GIVEN:
            keys = {k: ~given.masks[k] for k in even_frames(given.count, count)}
            found[name] = replace(given, masks=~np.stack(carry_masks(motion, keys, margin).excluded))
    return found


def common_tissue(folder: str) -> BoolArray:
    """(n, H, W) True where the masks of all rows show tissue."""
    return np.logical_and.reduce([sequence.masks for sequence in sequences(folder).values()])


def of_run(folder: str, row: str, seed: int) -> dict[str, Any]:
    """PSNR on the common tissue of every held-out frame, dB, and the tissue that the training sees."""
    sequence, common = sequences(folder)[row], common_tissue(folder)
    run = endotsr.train(sequence, preset=PRESET, training={"seed": seed}, on_message=lambda text: None)
    held_out = [int(i) for i in sequence.test_index]
    renders = [run.render(float(sequence.times[i]), i).colour for i in held_out]
    truth = [sequence.frame(i).image for i in held_out]
    values = [psnr_tissue(a.astype(b.dtype), b, common[i]) for a, b, i in zip(renders, truth, held_out, strict=True)]
    tissue = float(sequence.masks[sequence.train_index].mean())
    return {"frames": held_out, "psnr": values, "tissue": tissue, "common": float(common[held_out].mean())}


def table(result: dict[str, Any]) -> str:
    """One row per clip and masks; the difference is that of runs with equal seeds."""
    rows = []
    for clip, by_row in result["clips"].items():
        base = [np.mean(run["psnr"]) for run in by_row[GIVEN]]
        for name, runs in by_row.items():
            means = [float(np.mean(run["psnr"])) for run in runs]
            differences = [float(a - b) for a, b in zip(means, base)]
            against = "-" if name == GIVEN else shown(differences, 2)
            rows.append([f"`{clip}`", name, str(len(runs)), f"{runs[0]['tissue']:.1%}", shown(means, 2), against])
    about = f"Preset `{PRESET}`, mean ± 95 % interval over the seeds; {where(result)}."
    head = ["Clip", "Masks", "seeds", "tissue in training", "PSNR of common tissue, dB", "against given, dB"]
    return noted(head, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Clip -> row -> numbers of the runs in the order of their seeds."""
    folders = {folder.name: str(folder.resolve()) for folder in options.clips}
    seeds = range(options.seeds)
    runs = [(clip, row, seed) for clip in folders for seed in seeds for row in ROWS if seed < SEEDS[row]]
    about = {"sources": kept.sources("method", "training"), "rows": ROWS, "preset": PRESET}
    answers = kept.measured(options.record, about, runs, lambda clip, *run: of_run(folders[clip], *run))
    return {"clips": kept.nested(answers)}


PROGRAM = Program(
    __name__, "guides/masks.md", {"table": table}, "masks_training.json", measured,
    {"clips": {**CLIPS, "nargs": "+"}, "--seeds": max(SEEDS.values())}, room="mask_training",
)  # fmt: skip
