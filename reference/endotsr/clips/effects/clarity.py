"""Smoke and blur: frames with much less fine contrast than the others.

The sharpness of a frame is the mean squared Laplacian over tissue at full size, less the contribution of noise, divided
by the squared brightness. It is invariant to gain. Blur lowers the sharpness and hardly changes the darkest tissue.
Smoke adds light everywhere, which also raises the dark channel (the smallest channel, tenth percentile over tissue).
Blur is a fall below the median of the neighbours in time, smoke a fall below the upper quartile of the sharpness with a
rise above the lower quartile of the dark channel. Both are found only if they vary: a clip that is blurred throughout
has no sharp frame for comparison. A frame without tissue shows neither, and no other frame is compared with it.
"""

import numpy as np

from endotsr.clips.effects.frames import ReducedFrames, without_gaps
from endotsr.clips.effects.noise import NORMAL_MAD, Noise
from endotsr.clips.effects.verdict import Curve, EffectVerdict
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray

BLUR = np.log(2.0)  # fall of the log sharpness below the local median
SMOKE_FALL = np.log(1.5)
SMOKE_RISE = 0.05  # of the dark channel, display units
SCATTER = 4.0  # for blur, a fall must also exceed this many deviations (MAD) of the frames
SQUARES, CHANNELS = 20.0, 3.0  # of the weights 4 -1 -1 -1 -1 of the Laplacian; averaged to grey
MEASURABLE = 0.1  # least energy, of that of the noise
NEIGHBOURS = 4  # frames on either side: slow changes, such as of the view, are not blur


def clarity_verdicts(sequence: Sequence, clip: ReducedFrames, noise: Noise) -> tuple[EffectVerdict, EffectVerdict]:
    """Verdicts on smoke and on blur."""
    rows = [_measures(sequence.images[i], sequence.masks[i], noise.level) for i in sequence.train_index]
    sharpness, dark = (np.array(column) for column in zip(*rows))
    seen = np.isfinite(sharpness)
    if seen.any():
        sharpness, dark = without_gaps(sharpness, clip.times), without_gaps(dark, clip.times)
    else:
        sharpness, dark, seen = np.zeros(clip.count), np.zeros(clip.count), ~seen
    fall = _local_median(sharpness) - sharpness
    slow_fall = np.percentile(sharpness[seen], 75) - sharpness
    rise = dark - np.percentile(dark[seen], 25)
    spread = SCATTER * float(np.median(np.abs(fall - np.median(fall)))) / NORMAL_MAD
    score = np.where(seen, np.minimum(rise / SMOKE_RISE, slow_fall / SMOKE_FALL), 0.0)
    smoke = _verdict("smoke", score, 1.0, "times the threshold", "rise of the dark channel with a fall of sharpness",
                     clip, {"dark channel": dark})  # fmt: skip
    clear = np.where(seen & (score < 1.0), fall, 0.0)
    blur = _verdict("blur", clear, max(BLUR, spread), "natural logarithm", "fall of the log sharpness below its"
                    " neighbours", clip, {"log sharpness": sharpness})  # fmt: skip
    return smoke, blur


def clear_frames(clip: ReducedFrames, *verdicts: EffectVerdict) -> BoolArray:
    """(m,) False for the training frames listed in verdicts of `clarity_verdicts`."""
    clear = np.ones(clip.count, bool)
    for verdict in verdicts:
        clear[verdict.details["frames"]] = False
    return clear


def _measures(image: np.ndarray, mask: np.ndarray, sigma: float) -> tuple[float, float]:
    """Log sharpness and dark channel of a frame (3, H, W) uint8; NaN without tissue."""
    inner = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    if not inner.any():
        return np.nan, np.nan
    grey = image.mean(axis=0, dtype=np.float32) / np.float32(255)
    curved = 4 * grey[1:-1, 1:-1] - grey[:-2, 1:-1] - grey[2:, 1:-1] - grey[1:-1, :-2] - grey[1:-1, 2:]
    energy = float((curved[inner] ** 2).mean()) - SQUARES * sigma**2 / CHANNELS
    bright = float(grey[1:-1, 1:-1][inner].mean())
    least = MEASURABLE * SQUARES * sigma**2 / CHANNELS + 1e-8
    sharpness = float(np.log(max(energy, least) / max(bright, 1e-3) ** 2))
    dark = float(np.percentile(image.min(axis=0)[mask], 10)) / 255
    return sharpness, dark


def _local_median(course: FloatArray) -> FloatArray:
    from scipy.ndimage import median_filter

    return median_filter(course, size=2 * NEIGHBOURS + 1, mode="nearest")


def _verdict(
    effect: str,
    score: FloatArray,
    threshold: float,
    unit: str,
    test: str,
    clip: ReducedFrames,
    lines: dict[str, FloatArray],
) -> EffectVerdict:
    bad = np.flatnonzero(score >= threshold)
    statistic = float(score.max()) if score.size else 0.0
    reason = f"{len(bad)} of {clip.count} training frames show {effect}."
    reason = reason if bad.size else f"No training frame shows {effect}."
    kind, curve = effect if bad.size else "none", Curve(", ".join(lines), "time", clip.times, lines)
    details = {"frames": bad.tolist()}
    return EffectVerdict(effect, bool(bad.size), kind, statistic, threshold, unit, test, 0.01, reason, details, curve)
