"""Train with carried masks and with the given ones, over seeds, and write the table of docs/guides/masks.md.

    python docs/make.py recordings.masks_training CLIP ...   train, some minutes a run
    python docs/make.py recordings.masks_training            rewrite the table of the last result

A CLIP is a folder in the layout of EndoNeRF. The key frames are evenly spaced, and their masks are those of `gt_masks`.
All runs of a clip are measured on the same pixels of the held-out frames: tissue in the given masks and in the carried
masks of every row. Finished runs are kept, and a stopped command continues. The result is
docs/results/masks_training.json.
"""

import argparse
from dataclasses import replace
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import endotsr
from endotsr.clips.sequences.carry_masks import carry_masks
from endotsr.clips.sequences.clip_flows import motion_of
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.results.report.tables import markdown
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import machine
from pages.store import kept
from pages.store.intervals import shown
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
FILE, PAGE = DOCS / "results" / "masks_training.json", DOCS / "guides" / "masks.md"
GIVEN, PRESET = "given", "quick"
ROWS = {GIVEN: (0, 0), "8 keys, margin 2": (8, 2), "4 keys, margin 2": (4, 2), "8 keys, margin 0": (8, 0)}
SEEDS = {GIVEN: 3, "8 keys, margin 2": 3, "4 keys, margin 2": 1, "8 keys, margin 0": 1}


def even_keys(frames: int, count: int) -> list[int]:
    """`count` evenly spaced frames with the first and the last one; one key is the middle frame."""
    return [frames // 2] if count == 1 else np.unique(np.linspace(0, frames - 1, count).round().astype(int)).tolist()


@cache
def sequences(folder: str) -> dict[str, Sequence]:
    """The sequence with the masks of every row."""
    given = endotsr.load_sequence(folder, masks="gt_masks")
    motion = motion_of([image.transpose(1, 2, 0) for image in given.images])
    found = {GIVEN: given}
    for name, (count, margin) in ROWS.items():
        if name != GIVEN:
            keys = {k: ~given.masks[k] for k in even_keys(given.count, count)}
            found[name] = replace(given, masks=~np.stack(carry_masks(motion, keys, margin).excluded))
    return found


def common_tissue(folder: str) -> BoolArray:
    """(n, H, W) True where the masks of all rows show tissue."""
    return np.logical_and.reduce([sequence.masks for sequence in sequences(folder).values()])


def measured(key: str, runs: dict[str, tuple[str, str, int]]) -> dict[str, Any]:
    """PSNR on the common tissue of every held-out frame, dB, and the tissue that the training sees."""
    folder, row, seed = runs[key]
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
    about = (
        f"Preset `{PRESET}`, mean ± 95 % interval over the seeds; {result['machine']['processor']}, {result['date']}."
    )
    head = ["Clip", "Masks", "seeds", "tissue in training", "PSNR of common tissue, dB", "against given, dB"]
    return markdown(head, rows) + "\n\n" + about


def main(words: list[str]) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clips", nargs="*", type=Path, metavar="CLIP")
    parser.add_argument("--seeds", type=int, default=max(SEEDS.values()), help="at most so many")
    options = parser.parse_args(words)
    if options.clips:
        folders = [str(folder.resolve()) for folder in options.clips]
        runs = {
            f"{Path(folder).name}, {row}, seed {seed}": (folder, row, seed)
            for folder in folders
            for seed in range(options.seeds)
            for row in ROWS
            if seed < SEEDS[row]
        }
        about = {"sources": kept.sources("method", "training"), "rows": ROWS, "preset": PRESET}
        answers = kept.measured(FILE, about, runs, lambda key: measured(key, runs))
        clips: dict[str, Any] = {}
        for key, (folder, row, _) in runs.items():
            clips.setdefault(Path(folder).name, {}).setdefault(row, []).append(answers[key])
        write_json(FILE, {"date": date.today().isoformat(), "machine": machine(), "clips": clips})
        kept.finished(FILE)
    write_marked(
        PAGE, {"table": table(read_json(FILE, "python docs/make.py recordings.masks_training"))}, "mask_training"
    )
