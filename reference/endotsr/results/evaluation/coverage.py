"""Held-out pixels that training hardly shows, and held-out frames outside the time of the training frames.

A held-out pixel is *never seen* if it is excluded in every training frame, and *seen once* if it is tissue in one of
them. The count is taken at the pixel, so it needs a camera that does not move. A held-out frame is *extrapolated* if it
has no training frame before it or none after it. Specification: metrics, *Coverage*.
"""

import math
from collections.abc import Iterable
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.results.evaluation.metrics import psnr_tissue

TimesSeen = NDArray[np.int32]  # (H, W) number of training frames in which a pixel is tissue
LEAST_SEEN = {"psnr_seen": 1, "psnr_seen_twice": 2}  # key in metrics.json -> least number of training frames


class FrameCoverage(TypedDict):
    """Numbers of pixels of a held-out frame."""

    frame: int
    tissue: int
    never_seen: int  # of the tissue: excluded in every training frame
    seen_once: int  # of the tissue: tissue in one training frame


def times_seen(sequence: Sequence) -> TimesSeen | None:
    """Number of training frames in which each pixel is tissue; None if the camera moves."""
    if not sequence.static_camera:
        return None
    seen = np.zeros(sequence.masks.shape[1:], np.int32)
    for i in sequence.train_index:
        seen += sequence.masks[i]
    return seen


def seen_metrics(render: FloatArray, truth: FloatArray, mask: BoolArray, seen: TimesSeen) -> dict[str, float | None]:
    """PSNR (M1) in dB over the tissue pixels that at least one, and at least two training frames show.

    render, truth  (3, H, W) display units; the render is clipped to [0, 1] first;  mask (H, W), True = tissue
    Edges:   no such pixel: None; equal images: inf
    """
    shown = np.clip(render, 0.0, 1.0)
    by_count: dict[int, float | None] = {0: None}  # pixels seen twice are seen once: equal counts, equal sets
    found = {}
    for key, least in LEAST_SEEN.items():
        pixels = mask & (seen >= least)
        count = int(np.count_nonzero(pixels))
        if count not in by_count:
            by_count[count] = psnr_tissue(shown, truth, pixels)
        found[key] = by_count[count]
    return found


def coverage(sequence: Sequence, indices: Iterable[int], seen: TimesSeen) -> list[FrameCoverage]:
    """The numbers of never seen and once seen tissue pixels of each of the frames `indices`."""
    rows: list[FrameCoverage] = []
    for i in map(int, indices):
        mask = sequence.masks[i]
        never, once = (int(np.count_nonzero(mask & (seen == times))) for times in (0, 1))
        rows.append({"frame": i, "tissue": int(mask.sum()), "never_seen": never, "seen_once": once})
    return rows


def extrapolated(sequence: Sequence, indices: Iterable[int]) -> list[int]:
    """Those of the frames `indices` that are before the first or after the last training frame."""
    train = [int(i) for i in sequence.train_index]
    first, last = min(train, default=math.inf), max(train, default=-math.inf)
    return [i for i in map(int, indices) if not first < i < last]
