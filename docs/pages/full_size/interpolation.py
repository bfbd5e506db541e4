"""Predictions without a model on both EndoNeRF clips: the plain ones, and those that obey the masks.

    python docs/make.py full_size.interpolation measure CLIP [--lpips FILE] [--splits NAME ...]

A measurement replaces the splits of its clip in the record and keeps the others.
The table is in docs/results/README.md between its marks, and the headline of README.md reads the same record.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np

import endotsr
from endotsr.clips.sequences.sequence import Sequence
from endotsr.results.evaluation.baselines import RenderFrame
from endotsr.results.evaluation.evaluate import EVERY_BASELINE, evaluate_frames
from endotsr.results.evaluation.lpips import load_lpips_weights
from endotsr.results.report.tables import markdown
from pages.store.commands import loaded
from pages.store.intervals import interval
from pages.store.program import CLIP, LPIPS, Program
from pages.store.tables import where

SPLITS: dict[str, dict[str, Any]] = {
    "every eighth frame": {},
    **{f"blocks of {n} frames": {"split": "blocks", "block_length": n} for n in (4, 8, 16)},
}


LEFT_OUT = {"endonerf_cutting": (73, 74)}  # in these frames the masks differ from those of their neighbours
NAMES = [name for name in EVERY_BASELINE if name != "temporal_mean"]
TISSUE_ONLY = ("two_neighbours_tissue", "flow_interpolation_tissue")
COLUMNS = (("psnr_full", 2), ("psnr_tissue", 2), ("ssim_full", 4), ("lpips", 4))
HEADS = ("PSNR full, dB", "PSNR tissue, dB", "SSIM full", "LPIPS [0,1]")


def plain_renders(sequence: Sequence) -> dict[str, RenderFrame]:
    """The predictions without a model."""
    return {name: EVERY_BASELINE[name][1](sequence) for name in NAMES}


def of_split(
    folder: str, split: str, weights: Any, renders: Callable[[Sequence], dict[str, RenderFrame]]
) -> dict[str, Any]:
    """Prediction -> metric -> value of every held-out frame of a split."""
    sequence = endotsr.load_sequence(folder, **SPLITS[split])
    rows = {}
    for name, render in renders(sequence).items():
        frames = evaluate_frames(sequence, sequence.test_index, render, weights)["per_frame"]
        rows[name] = {key: [row[key] for row in frames] for key, _ in COLUMNS}
    return {"frames": [int(i) for i in sequence.test_index], "baselines": rows}


def mean(part: dict[str, Any], name: str, key: str, without: tuple[int, ...] = ()) -> float:
    """Mean of a metric over the held-out frames, some of them left out; NaN if it was not measured."""
    pairs = zip(part["frames"], part["baselines"][name][key])
    values = [value for frame, value in pairs if frame not in without and value is not None]
    return float(np.mean(values)) if values else float("nan")


def tissue_only(
    clip: str, split: str, without: tuple[int, ...] = (), frames: list[int] | None = None
) -> dict[str, dict[str, float]]:
    """Baseline that obeys the masks -> metric -> mean over the held-out frames, some of them left out.

    frames   those that have to be the held-out ones, if given. Empty if they are others, or not measured
    """
    part = PROGRAM.read()["clips"].get(clip, {}).get(split)
    if part is None or frames not in (None, part["frames"]):
        return {}
    return {name: {key: mean(part, name, key, without) for key, _ in COLUMNS} for name in TISSUE_ONLY}


def half_width(part: dict[str, Any], name: str, key: str) -> float:
    """Half width of the 95 % interval of the mean over the held-out frames, as if they were independent."""
    return interval([value for value in part["baselines"][name][key] if value is not None])[1]


def row(part: dict[str, Any], name: str, without: tuple[int, ...]) -> list[str]:
    """Cells of a baseline: full and tissue PSNR, SSIM, LPIPS; in brackets without the frames that are left out."""
    cells = []
    for key, digits in COLUMNS:
        cell = f"{mean(part, name, key):.{digits}f}"
        cell += f" ± {half_width(part, name, key):.{digits}f}" if key == "psnr_tissue" else ""
        cells.append(cell + (f" ({mean(part, name, key, without):.{digits}f})" if without else ""))
    return [EVERY_BASELINE[name][0], *(cell.replace("nan", "-") for cell in cells)]


def frames_text(frames: tuple[int, ...]) -> str:
    """The numbers of some frames as text: frame 73, frames 73 and 74."""
    return f"frame{'s' * (len(frames) > 1)} {' and '.join(map(str, frames))}"


def held_out_text(clip: str, split: str, part: dict[str, Any], without: tuple[int, ...]) -> str:
    """The first head of a table: clip, split and number of frames."""
    brackets = f"; in brackets without {frames_text(without)}" if without else ""
    return f"{clip}, {split} held out ({len(part['frames'])} frames{brackets})"


def table(result: dict[str, Any]) -> str:
    """One table for each clip and split."""
    parts = []
    for clip, splits in result["clips"].items():
        for split, part in splits.items():
            without = tuple(k for k in LEFT_OUT.get(clip, ()) if k in part["frames"])
            head = (held_out_text(clip, split, part, without), *HEADS)
            parts.append(markdown(head, [row(part, name, without) for name in NAMES]))
    note = "± is a 95 % interval over the frames, as if they were independent. "
    note += "The first three rows read every pixel of the other frames, instruments included."
    lacking = [f"{clip}, {split}" for clip, found in result["clips"].items() for split in SPLITS if split not in found]
    note += f" Not measured yet: {'; '.join(lacking)}." if lacking else ""
    return "\n\n".join([*parts, f"{where(result)}. {note}"])


def measured(
    options: argparse.Namespace, renders: Callable[[Sequence], dict[str, RenderFrame]] = plain_renders
) -> dict[str, Any]:
    """The record with the splits of one clip measured."""
    weights = load_lpips_weights(options.lpips)
    clips = loaded(options.record)["clips"] if options.record.exists() else {}
    made = {split: of_split(str(options.clip), split, weights, renders) for split in options.splits}
    return {"clips": clips | {options.clip.name: clips.get(options.clip.name, {}) | made}}


OPTIONS = {"clip": CLIP, "--lpips": LPIPS, "--splits": {"nargs": "+", "choices": SPLITS, "default": list(SPLITS)}}
PROGRAM = Program(__name__, "results/README.md", {"table": table}, "interpolation.json", measured, OPTIONS)
