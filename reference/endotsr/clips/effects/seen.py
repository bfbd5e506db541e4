"""Tests that need no motion estimate: occluders, highlights, and the quality of the prior depth."""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.effects.frames import ReducedFrames
from endotsr.clips.effects.noise import NORMAL_MAD
from endotsr.clips.effects.verdict import Curve, EffectVerdict, Map, sentence
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray

SATURATED, COLOURLESS = 0.98, 0.1  # a highlight: largest channel above, (max - min) / max below
LEAST_HIGHLIGHT = 1e-3  # fraction of the tissue
LEAST_PIXELS = 10  # with depth, in a usable frame
HOLES = 0.01  # fraction of the tissue
RELATIVE = 1e-3  # of the median depth: threshold for steps and flicker
MOST_LEVELS = 4096  # a frame with more distinct values, or more than a quarter of its pixels, is not quantised


def occluder_verdict(sequence: Sequence, clip: ReducedFrames) -> EffectVerdict:
    """Whether the masks exclude any pixel of a training frame; a fact, not an estimate."""
    masks = sequence.masks[sequence.train_index]
    by_frame = 1.0 - masks.mean(axis=(1, 2))
    always, ever = (~masks).all(axis=0), (~masks).any(axis=0)
    excluded = float(by_frame.mean())
    moves = bool((ever & ~always).any())
    kind = "none" if excluded == 0 else "moving" if moves else "fixed"
    reason = {
        "none": "The masks exclude no pixel.",
        "fixed": f"The masks exclude the same {excluded:.1%} of the pixels in every frame.",
        "moving": f"The masks exclude {excluded:.1%} of the pixels; {always.mean():.1%} are never seen.",
    }[kind]
    curve = Curve("excluded, percent of the pixels", "time", clip.times, {"excluded": 100 * by_frame})
    picture = Map("excluded, percent of the frames", 100 * (~clip.masks).mean(axis=0))
    details = {"never_seen": float(always.mean())}
    return EffectVerdict("occluders", excluded > 0, kind, excluded, 0.0, "fraction of the pixels",
                         "excluded pixels", 0.0, reason, details, curve, picture)  # fmt: skip


def highlight_verdict(sequence: Sequence, clip: ReducedFrames) -> EffectVerdict:
    """The verdict on saturated, colourless tissue pixels at full size."""
    fractions, sums = [], np.zeros((sequence.height, sequence.width))
    for i in sequence.train_index:
        bright = highlights(sequence.images[i]) & sequence.masks[i]
        fractions.append(bright.sum() / max(int(sequence.masks[i].sum()), 1))
        sums += bright
    fraction = np.array(fractions)
    statistic = float(fraction.mean())
    fixed = float((sums >= 0.9 * len(fraction)).sum() / max(int((sums > 0).sum()), 1))
    present = statistic >= LEAST_HIGHLIGHT
    kind = "none" if not present else "fixed" if fixed > 0.5 else "moving"
    reason = f"Saturated pixels without colour cover {statistic:.2%} of the tissue."
    side = clip.shrink
    cut = sums[: sums.shape[0] // side * side, : sums.shape[1] // side * side]
    picture = cut.reshape(cut.shape[0] // side, side, cut.shape[1] // side, side).mean(axis=(1, 3))
    return EffectVerdict("highlights", present, kind, statistic, LEAST_HIGHLIGHT, "fraction of the tissue",
                         "saturated pixels without colour", 0.01, reason, {"fixed_fraction": fixed},
                         Curve("highlights, percent of the tissue", "time", clip.times, {"highlights": 100 * fraction},
                         100 * LEAST_HIGHLIGHT),
                         Map("highlight, percent of the frames", 100 * picture / len(fraction)))  # fmt: skip


def highlights(image: NDArray[np.uint8]) -> BoolArray:
    """(3, H, W) uint8 to (H, W) bool: largest channel above 0.98, smallest channel within 10 % of the largest."""
    largest, smallest = image.max(axis=0).astype(np.float32), image.min(axis=0).astype(np.float32)
    return (largest > SATURATED * 255) & (largest - smallest < COLOURLESS * largest)


def depth_verdict(sequence: Sequence, clip: ReducedFrames) -> EffectVerdict:
    """The verdict on faults of the prior depth. `details["usable"]`: whether any frame has enough depth."""
    depth, known = clip.depth, (clip.depth > 0) & clip.masks
    tissue = clip.masks.sum(axis=(1, 2))
    seen = (tissue > 0) | ~tissue.any()  # a frame without tissue lacks no depth
    by_frame = np.where(seen, 1.0 - known.sum(axis=(1, 2)) / np.maximum(tissue, 1), 0.0)
    usable = [int(k.sum()) >= LEAST_PIXELS and float(np.ptp(d[k])) > 0 for d, k in zip(depth, known)]
    median = float(np.median(depth[known])) if known.any() else 0.0
    holes, step, flicker = float(by_frame[seen].mean()), quantisation(depth, known), temporal_flicker(clip)
    limit = max(RELATIVE * median, 1e-30)
    scores = {"holes": holes / HOLES, "quantised": step / limit, "flicker": flicker / (limit + 0.5 * step)}
    found = [name for name, score in scores.items() if score >= 1.0]
    words = {
        "holes": f"{holes:.1%} of the tissue has no depth",
        "quantised": f"depth moves in steps of {step:.3g} {sequence.unit}",
        "flicker": f"depth flickers by {flicker:.3g} {sequence.unit} (standard deviation)",
    }
    reason = sentence(words, found, "Depth is dense, fine and steady.")
    score = max(scores.values()) if any(usable) else 1.0 / HOLES  # as without depth
    if not any(usable):
        found, reason = ["unusable"], "No training frame has ten pixels of depth that differ."
    details = {"usable": any(usable), "holes": holes, "step": step, "flicker": flicker, "median_depth": median}
    missing = np.where(clip.masks, depth <= 0, False).mean(axis=0)
    test = "holes over 1 % of tissue, step over 0.1 % of the median depth, flicker over that and half a step"
    curve = Curve("tissue without depth, percent", "time", clip.times, {"holes": 100 * by_frame}, 100 * HOLES)
    picture = Map("no depth on tissue, percent of the frames", 100 * missing)
    return EffectVerdict("depth quality", bool(found), " + ".join(found) or "good", score, 1.0,
                         "times the threshold", test, 0.01, reason, details, curve, picture)  # fmt: skip


def quantisation(depth: np.ndarray, known: np.ndarray) -> float:
    """The median step between successive distinct values of a frame, scene units; 0 if it is not quantised."""
    steps = []
    for d, k in zip(depth, known):
        values = np.unique(d[k])
        if 2 <= values.size <= min(MOST_LEVELS, 0.25 * max(int(k.sum()), 1)):
            steps.append(float(np.median(np.diff(values))))
    return float(np.median(steps)) if steps else 0.0


def temporal_flicker(clip: ReducedFrames) -> float:
    """The flicker of depth as a standard deviation, scene units: the median over frames.

    Of a frame it is the smaller of two estimates, by the median absolute second difference over time and along rows.
    Only frames in the middle of two equal time steps count.
    """
    found = []
    for k in range(1, clip.count - 1):
        d = clip.depth[k - 1 : k + 2].astype(np.float64)
        known = np.logical_and.reduce((d > 0) & clip.masks[k - 1 : k + 2], axis=0)
        if not known.any() or abs(clip.times[k + 1] - 2 * clip.times[k] + clip.times[k - 1]) > 1e-9:
            continue
        over_time = np.median(np.abs((d[0] - 2 * d[1] + d[2])[known])) / (NORMAL_MAD * 6**0.5)
        cross = d[1, 1:-1, :-2] - 2 * d[1, 1:-1, 1:-1] + d[1, 1:-1, 2:]
        inner = known[1:-1, :-2] & known[1:-1, 1:-1] & known[1:-1, 2:]
        over_picture = np.median(np.abs(cross[inner])) / (NORMAL_MAD * 6**0.5) if inner.any() else np.inf
        found.append(min(over_time, over_picture))
    return float(np.median(found)) if found else 0.0
