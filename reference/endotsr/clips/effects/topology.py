"""Change of topology, for example by cutting: tissue visible at only one end of the clip.

The first and the last frame are references. Frames of both ends are warped onto each reference along their flow, and
the local structure around every pixel is correlated with the reference. A pixel counts as lost if the frames of its own
end agree with the reference and no frame of the other end does. A slit, its wound or blood leaves a connected region of
lost pixels. Regions thinner than three pixels count as flow failures and are dropped.

A cut that closes before the end of the clip is not found. Permanently covered tissue (blood, a clip, a swab) is also
found: in both cases, no motion maps the tissue at one end to the tissue at the other. A moving camera also brings new
tissue into view; the verdict is then "unknown".
"""

from typing import NamedTuple, cast

import numpy as np

from endotsr.clips.effects.frames import ReducedFrames
from endotsr.clips.effects.noise import Noise
from endotsr.clips.effects.tracks import matched
from endotsr.clips.effects.verdict import UNKNOWN, EffectVerdict, Map
from endotsr.clips.opencv.flow import warp_bilinear
from endotsr.method.kernels.arrays import BoolArray, FloatArray

WINDOW = 2.5  # Gaussian radius of the local structure, working pixels
AGREES = 0.8  # minimum median correlation with the frames of the same end
LOST = 0.5  # every correlation with the other end is lower
LEAST_FRAMES = 3  # per end
END_FRACTION = 1.0 / 8.0  # of the frames belong to an end
LEAST_REGION = 0.003  # of the tissue visible at both ends
LEAST_COMMON = 0.7  # minimum fraction of agreeing pixels that are found again; below it, the ends show different tissue


class End(NamedTuple):
    """Tissue visible at one end of the clip and not at the other, on the grid of the outermost frame of that end."""

    agrees: BoolArray  # (h, w) the frames of this end agree with its outermost one
    seen: BoolArray  # (h, w) the other end shows this position
    lost: BoolArray  # (h, w) agrees and seen, but no frame of the other end shows this structure
    region: int  # pixels of the largest connected region of `lost`

    @property
    def common(self) -> float:
        """Fraction of the agreeing pixels that the other end also shows."""
        candidates = int((self.agrees & self.seen).sum())
        return 1.0 - int(self.lost.sum()) / candidates if candidates else 0.0


def topology_verdict(clip: ReducedFrames, clear: BoolArray, noise: Noise, camera_moves: bool = False) -> EffectVerdict:
    """The verdict on tissue that appears or disappears permanently.

    clear    (m,) False for training frames with blur or smoke, or without tissue, which are not compared
    returns  kind "none", "suspected", or UNKNOWN: the ends have too little tissue in common, or the camera moves
    """
    frames = np.flatnonzero(clear)
    count = max(LEAST_FRAMES, round(END_FRACTION * len(frames)))
    if len(frames) < 2 * count:
        return _verdict(UNKNOWN, 0.0, clip, None, "There are too few clear frames to compare")
    first, last = frames[:count], frames[-count:][::-1]
    grey, sigma = clip.luminance, float(noise.working.mean())
    ends = [_end(clip, grey, *pair, sigma) for pair in ((first, last), (last, first))]
    needed = [LEAST_REGION * max(int((end.agrees & end.seen).sum()), 1) for end in ends]
    statistic, end = max(((e.region / n, e) for e, n in zip(ends, needed)), key=lambda pair: pair[0])
    if min(e.common for e in ends) < LEAST_COMMON:
        return _verdict(UNKNOWN, statistic, clip, end, "The first and the last frames have little tissue in common")
    if camera_moves and statistic >= 1.0:
        return _verdict(UNKNOWN, statistic, clip, end, "The camera moves, which may bring tissue into view")
    return _verdict("suspected" if statistic >= 1.0 else "none", statistic, clip, end)


def _end(clip: ReducedFrames, grey: FloatArray, near: np.ndarray, far: np.ndarray, sigma: float) -> End:
    """Compare the frames of both ends with the outermost frame of the near one."""

    def with_reference(frames: np.ndarray) -> list[FloatArray]:
        return [local_correlation(clip, grey, int(near[0]), int(k), sigma) for k in frames]

    own = np.nan_to_num(_median(with_reference(near[1:])), nan=-1.0)
    best = np.fmax.reduce(with_reference(far))
    agrees, seen = own > AGREES, np.isfinite(best)
    lost = _without_single_pixels(agrees & seen & (best < LOST))
    return End(agrees, seen, lost, _largest_region(lost))


def _median(rows: list[FloatArray]) -> FloatArray:
    """The median over the frames that see a pixel; NaN if none does."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # "All-NaN slice" is a valid result here
        return np.nanmedian(np.array(rows), axis=0)


def local_correlation(clip: ReducedFrames, grey: FloatArray, reference: int, other: int, sigma: float) -> FloatArray:
    """Correlation (h, w) of the local structure of a frame with another frame that is warped onto it.

    grey     (m, h, w) luminance of the clip
    sigma    standard deviation of its noise
    returns  in [-1, 1]; NaN where either frame shows no tissue or the flow leaves the picture
    """
    match = matched(clip, grey, reference, other, sigma)
    moved = warp_bilinear(match.end.astype(np.float32)[None], match.flow)[0]
    return np.where(match.seen, _correlation(match.start.astype(np.float32) - 128, moved - 128, match.seen), np.nan)


def _correlation(a: FloatArray, b: FloatArray, seen: BoolArray) -> FloatArray:
    """Normalised correlation in a Gaussian window over the visible pixels."""
    from scipy.ndimage import gaussian_filter

    weight = seen.astype(np.float32)

    def mean(values: FloatArray) -> FloatArray:
        return gaussian_filter(values * weight, WINDOW) / total

    total = np.maximum(gaussian_filter(weight, WINDOW), 1e-3)
    mean_a, mean_b = mean(a), mean(b)
    variance_a, variance_b = mean(a * a) - mean_a**2, mean(b * b) - mean_b**2
    # variances below one squared grey level are rounding noise
    return (mean(a * b) - mean_a * mean_b) / np.sqrt(np.maximum(variance_a, 1.0) * np.maximum(variance_b, 1.0))


def _without_single_pixels(lost: BoolArray) -> BoolArray:
    from scipy.ndimage import binary_opening

    return np.asarray(binary_opening(lost, np.ones((3, 3), bool)), bool)


def _largest_region(lost: BoolArray) -> int:
    from scipy.ndimage import label

    numbers, _ = cast(tuple[np.ndarray, int], label(lost))
    return int(np.bincount(numbers.ravel())[1:].max(initial=0))


def _verdict(kind: str, statistic: float, clip: ReducedFrames, end: End | None, why: str = "") -> EffectVerdict:
    """The verdict; `why` is the reason for an unknown one."""
    pixels = 0 if end is None else end.region * clip.shrink**2
    reason = {
        UNKNOWN: f"{why}; no change is assumed.",
        "none": "The first frames show all tissue of the last ones, and the other way round.",
        "suspected": f"One end of the clip shows a region of {pixels} pixels that the other end does not.",
    }[kind]
    picture = np.full(clip.images.shape[2:], np.nan) if end is None else _picture(end)
    return EffectVerdict("topology change", kind == "suspected", kind, statistic, 1.0, "times the threshold",
                         "largest region that only one end of the clip shows, over 0.3 % of the tissue", 0.05, reason,
                         {"pixels": pixels}, None, Map("tissue that only one end shows", picture))  # fmt: skip


def _picture(end: End) -> FloatArray:
    """1 where tissue is lost, 0 where it is found again, NaN where unknown."""
    return np.where(end.agrees & end.seen, end.lost.astype(float), np.nan)
