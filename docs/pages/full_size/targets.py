"""PSNR of the targets between the frames (B14) against held-out frames, which they do not read.

    python docs/make.py full_size.targets measure SEQUENCE [--scale S]

The table is in docs/specification/b14_between.md between its marks.
"""

import argparse
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import endotsr
from endotsr.clips.flow.between import Flows, Gap, flows_between, frame_between, gap_between, motion_between
from endotsr.clips.flow.tissue_colours import tissue_colours
from endotsr.clips.opencv.flow import warp_cubic
from endotsr.clips.sequences.sequence import Sequence
from endotsr.results.evaluation.baselines import neighbours, two_neighbours, unit_image
from endotsr.training.runs.machine import dated
from pages.full_size.interpolation import SPLITS
from pages.store.program import CLIP, Program
from pages.store.tables import noted

KINDS = {
    "still": "both frames as they are",
    "moved": "both frames moved",
    "target": "the target",
    "tissue": "the target, if the flow read tissue alone",
}


def of_sequence(sequence: Sequence) -> dict[str, float]:
    """PSNR in dB over the tissue with a target, for every kind; `covered` is the fraction of such tissue."""
    gaps: dict[tuple[int, int], tuple[Gap, Gap]] = {}
    whole, filled = sequence, replace(sequence, images=_filled(sequence))
    error, covered, tissue = dict.fromkeys(KINDS, 0.0), 0, 0
    for index in (int(i) for i in sequence.test_index):
        near = neighbours(sequence, index)
        if near.before == near.after:
            continue
        pair = (near.before, near.after)
        if pair not in gaps:
            first = gap_between(sequence, *pair, flows_between(whole, *pair))
            gaps[pair] = first, first._replace(flows=flows_between(filled, *pair))
        frame, of_tissue = (frame_between(sequence, gap, near.fraction) for gap in gaps[pair])
        pictures = {"still": two_neighbours(sequence, index), "target": frame.image, "tissue": of_tissue.image}
        pictures["moved"] = _moved(sequence, pair, near.fraction, gaps[pair][0].flows)
        mask = sequence.masks[index] & frame.mask & of_tissue.mask
        covered, tissue = covered + int(mask.sum()), tissue + int(sequence.masks[index].sum())
        for kind in KINDS:
            squared = np.square(np.clip(pictures[kind], 0, 1) - unit_image(sequence, index)).mean(axis=0)
            error[kind] += float(squared[mask].sum(dtype=np.float64))
    return {kind: -10 * np.log10(e / covered) for kind, e in error.items()} | {"covered": covered / tissue}


def _filled(sequence: Sequence) -> NDArray[np.uint8]:
    """The pictures; those of the training frames without the colours that their masks exclude."""
    images = sequence.images.copy()
    for index in sequence.train_index:
        images[index] = tissue_colours(sequence, int(index))
    return images


def _moved(sequence: Sequence, pair: tuple[int, int], fraction: float, flows: Flows) -> np.ndarray:
    """The blend of both frames moved by the motion field, without the static pair and without masks."""
    field, a = motion_between(flows, fraction), np.float32(fraction)
    before, after = (unit_image(sequence, i) for i in pair)
    return (1 - a) * warp_cubic(before, -a * field) + a * warp_cubic(after, (1 - a) * field)


def table(result: dict[str, Any]) -> str:
    """One row per split."""
    rows = [
        [split, *(f"{row[kind]:.2f}" for kind in KINDS), f"{100 * row['covered']:.1f} %"]
        for split, row in result["splits"].items()
    ]
    head = ["Held out", *(f"{label}, dB" for label in KINDS.values()), "tissue with a target"]
    about = (
        "PSNR of the mean squared error over the tissue with a target of all held-out frames together, not the mean "
        f"over frames; {result['sequence']}, scale {result['scale']:g}, {result['date'][:10]}."
    )
    return noted(head, rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every split."""
    load = lambda of: endotsr.load_sequence(options.clip, scale=options.scale, **of)
    splits = {name: of_sequence(load(of)) for name, of in SPLITS.items()}
    return dated({"sequence": options.clip.name, "scale": options.scale, "splits": splits})


PROGRAM = Program(
    __name__, "specification/b14_between.md", {"table": table}, "targets.json", measured,
    {"clip": CLIP, "--scale": 1.0}, stamped=False,
)  # fmt: skip
