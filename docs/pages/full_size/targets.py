"""PSNR of the targets between the frames (B14) against held-out frames, which they do not read.

    python docs/make.py full_size.targets measure SEQUENCE [--scale S]
    python docs/make.py full_size.targets measure SEQUENCE --excluded     the effect of excluded pixels alone

The table and the effect of excluded pixels are in docs/specification/b14_between.md between their marks.
"""

import argparse
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

import endotsr
from endotsr.clips.opencv import warp_cubic
from endotsr.clips.sequences.between import Flows, flows_between, frame_between, motion_between
from endotsr.clips.sequences.sequence import Sequence
from endotsr.results.evaluation.baselines import neighbours, two_neighbours, unit_image
from endotsr.training.runs.machine import dated
from pages.full_size.interpolation import SPLITS
from pages.store.commands import loaded
from pages.store.program import CLIP, Program
from pages.store.tables import noted

GREY, HALF_STEP = 255, 0.5  # grey levels of a display unit; rounding of an 8-bit picture
KINDS = {"still": "both frames as they are", "moved": "both frames moved", "target": "the target"}


def of_sequence(sequence: Sequence) -> dict[str, float]:
    """PSNR in dB over the tissue with a target, for every kind; `covered` is the fraction of such tissue."""
    flows: dict[tuple[int, int], Flows] = {}
    error, covered, tissue = dict.fromkeys(KINDS, 0.0), 0, 0
    for index in (int(i) for i in sequence.test_index):
        near = neighbours(sequence, index)
        if near.before == near.after:
            continue
        pair = (near.before, near.after)
        if pair not in flows:
            flows[pair] = flows_between(sequence, *pair)
        frame = frame_between(sequence, *pair, near.fraction, flows[pair])
        pictures = {"still": two_neighbours(sequence, index), "target": frame.image}
        pictures["moved"] = _moved(sequence, pair, near.fraction, flows[pair])
        mask = sequence.masks[index] & frame.mask
        covered, tissue = covered + int(mask.sum()), tissue + int(sequence.masks[index].sum())
        for kind in KINDS:
            squared = np.square(np.clip(pictures[kind], 0, 1) - unit_image(sequence, index)).mean(axis=0)
            error[kind] += float(squared[mask].sum(dtype=np.float64))
    return {kind: -10 * np.log10(e / covered) for kind, e in error.items()} | {"covered": covered / tissue}


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
        f"PSNR over the tissue with a target; {result['sequence']}, scale {result['scale']:g}, {result['date'][:10]}."
    )
    return noted(head, rows, about)


def of_excluded(sequence: Sequence) -> dict[str, float]:
    """The change of the targets halfway between two training frames if the excluded pixels of both turn black.

    The flow stays that of the whole pictures. `largest` is in grey levels; `changed` is the fraction of the pixels
    inside the masks of the targets that change by more than half a grey level in a channel.
    """
    black = replace(sequence, images=np.where(sequence.masks[:, None], sequence.images, 0).astype(np.uint8))
    largest, changed, pixels = 0.0, 0, 0
    for pair in pairwise(int(i) for i in sequence.train_index):
        flows = flows_between(sequence, *pair)
        whole, masked = (frame_between(of, *pair, 0.5, flows) for of in (sequence, black))
        change = GREY * np.abs(whole.image - masked.image).max(axis=0)[whole.mask]
        largest, changed = max(largest, float(change.max())), changed + int((change > HALF_STEP).sum())
        pixels += change.size
    return {"largest": largest, "changed": changed / pixels}


def excluded(result: dict[str, Any]) -> str:
    """How much the targets depend on the colour of excluded pixels, apart from the flow."""
    found = result["excluded"]
    return (
        "If the excluded pixels of the two frames are made black and the flow is kept, "
        f"{100 * found['changed']:.1f} % of the pixels inside the masks of the targets change by more than half a grey "
        f"level, and one of them by {found['largest']:.0f} grey levels ({result['sequence']}, targets halfway between "
        f"successive training frames, every eighth frame held out; {found['date'][:10]})."
    )


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every split, and the effect of excluded pixels; with `--excluded` the stored splits."""
    load = lambda of: endotsr.load_sequence(options.clip, scale=options.scale, **of)
    if options.excluded:
        found = loaded(options.record)
    else:
        splits = {name: of_sequence(load(of)) for name, of in SPLITS.items()}
        found = dated({"sequence": options.clip.name, "scale": options.scale, "splits": splits})
    return found | {"excluded": dated(of_excluded(load(SPLITS["every eighth frame"])))}


PROGRAM = Program(
    __name__, "specification/b14_between.md", {"table": table, "excluded": excluded}, "targets.json", measured,
    {"clip": CLIP, "--scale": 1.0,
     "--excluded": {"action": "store_true", "help": "keep the splits, measure the effect of excluded pixels alone"}},
    stamped=False,
)  # fmt: skip
