"""Quality of the prior depth: holes, steps of quantisation, flicker; and whether it can be used at all."""

import numpy as np

from endotsr.effects.clip import Clip
from endotsr.effects.noise import NORMAL_MAD
from endotsr.effects.verdict import Curve, EffectVerdict, Map
from endotsr.sequences.sequence import Sequence

LEAST_PIXELS = 10  # with depth, for a frame to have any use
HOLES = 0.01  # fraction of the tissue
RELATIVE = 1e-3  # of the median depth: smaller steps and smaller flicker do not matter
MOST_LEVELS = 4096  # a frame with more values than this is not quantised


def depth_verdict(sequence: Sequence, clip: Clip) -> EffectVerdict:
    """Present = something is wrong with the depth. `details["usable"]` says whether any frame has enough of it."""
    depth, known = clip.depth, (clip.depth > 0) & clip.masks
    by_frame = 1.0 - known.sum(axis=(1, 2)) / np.maximum(clip.masks.sum(axis=(1, 2)), 1)
    usable = [int(k.sum()) >= LEAST_PIXELS and float(np.ptp(d[k])) > 0 for d, k in zip(depth, known)]
    median = float(np.median(depth[known])) if known.any() else 0.0
    holes, step, flicker = float(by_frame.mean()), quantisation(depth, known), temporal_flicker(clip)
    limit = max(RELATIVE * median, 1e-30)
    scores = {"holes": holes / HOLES, "quantised": step / limit, "flicker": flicker / (limit + 0.5 * step)}
    found = [name for name, score in scores.items() if score >= 1.0]
    words = {
        "holes": f"{holes:.1%} of the tissue has no depth",
        "quantised": f"depth moves in steps of {step:.3g} {sequence.unit}",
        "flicker": f"depth flickers by {flicker:.3g} {sequence.unit} (standard deviation)",
    }
    said = ", ".join(words[name] for name in found)
    reason = said[0].upper() + said[1:] + "." if said else "Depth is dense, fine and steady."
    if not any(usable):
        found, reason = ["unusable"], "No training frame has ten pixels of depth that differ."
    details = {"usable": any(usable), "holes": holes, "step": step, "flicker": flicker, "median_depth": median}
    missing = np.where(clip.masks, depth <= 0, False).mean(axis=0)
    test = "holes over 1 % of tissue, step and flicker over 0.1 % of the median depth"
    curve = Curve("tissue without depth, percent", "time", clip.times, {"holes": 100 * by_frame}, 100 * HOLES)
    picture = Map("no depth on tissue, percent of the frames", 100 * missing)
    return EffectVerdict("depth quality", bool(found), " + ".join(found) or "good", max(scores.values()), 1.0,
                         "times the threshold", test, 0.01, reason, details, curve, picture)  # fmt: skip


def quantisation(depth: np.ndarray, known: np.ndarray) -> float:
    """The median difference of neighbouring distinct values of a frame, scene units; 0 if there are very many."""
    steps = []
    for d, k in zip(depth, known):
        values = np.unique(d[k])
        if 2 <= values.size <= min(MOST_LEVELS, 0.25 * max(int(k.sum()), 1)):
            steps.append(float(np.median(np.diff(values))))
    return float(np.median(steps)) if steps else 0.0


def temporal_flicker(clip: Clip) -> float:
    """MAD of the second difference over time, or over rows and columns, whichever is smaller; scene units."""
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
