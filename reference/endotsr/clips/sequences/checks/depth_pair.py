"""Depth against the stereo pairs of the same clip: its scale, an offset, and distances along the ray.

In: a clip with right views and depth. Out: findings. A pixel of a pair with the disparity d has z = f b / d. Depth
times a number, depth plus a length, and distances along the ray instead of along the optical axis differ from it in
three ways, which one frame tells apart.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.poses.views import ViewFrame, reduced_camera, side_of
from endotsr.clips.sequences.checks.flips import NARROW, agreed_disparity
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.view_frames import with_planes
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray

SAMPLED, WIDEST = 4, 320  # frames of a clip, and columns of their pictures
LEAST_DISPARITY, FEWEST = 1.0, 2000  # pixels; pixels of a comparison
NEAR, AGREEING = 0.3, 0.6  # logarithm from the median ratio, and part of the pixels that are this near
ROUNDS, KEPT = 5, 2.5  # of a robust fit, and medians of the residuals within which a pixel counts
# On two recorded and twelve simulated clips, with depth in whole millimetres, and with the same depth made wrong:
ALONG_RAY = 0.7  # exponent: at most 0.08 on these clips, 0.93 or more with distances along the ray
OFFSET = 0.1  # of the median depth: at most 0.05 on these clips, 0.16 or more with 15 mm more
SCALE = 1.15  # of the depth to that of the pair, or the reverse: 0.99 to 1.01 on these clips
FLAT = 0.08  # of the median depth: the spread without which a scale and an offset look alike
FACTORS = ((5.0, "5000 steps a metre read as millimetres: --depth-scale 0.2"), (10.0, "tenths of a millimetre"),
           (0.1, "centimetres"), (1000.0, "micrometres"), (1e-3, "metres"))  # fmt: skip


class Compared(NamedTuple):
    """N pixels with a depth and a disparity."""

    depth: FloatArray  # (N,)
    of_pair: FloatArray  # (N,) f b / d; with b = 1 where the baseline is unknown
    ray: FloatArray  # (N,) length of the ray to depth 1


class DepthAgainstPair(NamedTuple):
    """What relates a depth to that of the pair."""

    ratio: float  # median of depth over that of the pair
    along_ray: float  # exponent of the length of the ray in this ratio
    scale: float  # depth = scale * that of the pair + offset
    offset: float
    usual: float  # median depth
    spread: float  # of the depth, 5th to 95th percentile


class DepthPairs:
    """The compared pixels of the sampled frames of a clip; no frame without right views and depth of known scale."""

    def __init__(self, clip: Clip) -> None:
        compared = clip.right and clip.depth is not None and not clip.depth.assumed
        self.clip, self.sampled = clip, set(even_frames(clip.count, SAMPLED)) if compared else set()
        self.found: list[Compared | None] = []

    def add(self, i: int, frame: ViewFrame, right: Picture) -> None:
        """Frame i of `sampled`. Raises InputError without a camera."""
        self.found.append(_compared(self.clip, i, frame, right))

    def findings(self) -> list[Finding]:
        """A warning where the depth contradicts the pairs; none if a sampled frame was left out."""
        if self.clip.depth is None or not self.sampled or len(self.found) < len(self.sampled):
            return []
        fit = pair_fit([one for one in self.found if one is not None])
        files = self.clip.depth.files
        where = str(files[0].parent) if files else str(self.clip.where)
        return [] if fit is None else fit_findings(fit, bool(self.clip.baseline), self.clip.unit_in_words, where)


def depth_pair_findings(clip: Clip) -> list[Finding]:
    """A warning where the depth of a clip contradicts its pairs; none without both, or with an assumed scale."""
    pairs = DepthPairs(clip)
    try:
        for i in sorted(pairs.sampled):
            left, right = next(clip.pictures([i]))
            if right is not None:
                pairs.add(i, with_planes(clip, i, left), right)
    except InputError:
        return []  # another finding names the file
    return pairs.findings()


def _compared(clip: Clip, i: int, frame: ViewFrame, right: Picture) -> Compared | None:
    """The pixels of one frame; None for a narrow picture, or views or a camera of another size."""
    whole = frame.image.shape[1:]
    if right.shape[:2] != whole or whole[1] <= NARROW:
        return None
    side, camera = side_of(whole[1], WIDEST), clip.cameras(range(i, i + 1))[0]
    if (camera.height, camera.width) != whole:
        return None
    frame, camera = frame.reduced(side), reduced_camera(camera, side)
    height, width = frame.tissue.shape
    right = area_resize(np.ascontiguousarray(right[: height * side, : width * side]), width, height)
    disparity = agreed_disparity(np.ascontiguousarray(frame.image.transpose(1, 2, 0)), right)
    if disparity is None:
        return None
    x, y = (np.arange(width) + 0.5 - camera.cx) / camera.fx, (np.arange(height) + 0.5 - camera.cy) / camera.fy
    ray = np.sqrt(1 + x**2 + y[:, None] ** 2)
    used = np.isfinite(disparity) & (np.nan_to_num(disparity) > LEAST_DISPARITY) & (frame.depth > 0) & frame.tissue
    of_pair = camera.fx * (clip.baseline or 1.0) / disparity[used].astype(np.float64)
    return Compared(frame.depth[used].astype(np.float64), of_pair, ray[used])


def pair_fit(found: list[Compared]) -> DepthAgainstPair | None:
    """The robust fits over all frames; None for few pixels, or where depth and pairs have little in common."""
    if sum(one.depth.size for one in found) < FEWEST:
        return None
    depth, of_pair, ray = (np.concatenate(values) for values in zip(*found))
    ratio = np.log(depth / of_pair)
    near = np.abs(ratio - np.median(ratio)) < NEAR
    if near.mean() < AGREEING:
        return None
    ones = np.ones(int(near.sum()))
    along = _fitted(np.column_stack([np.log(ray[near]), ones]), ratio[near])[0]
    scale, offset = _fitted(np.column_stack([of_pair[near], ones]), depth[near])
    low, high = np.percentile(depth[near], (5, 95))
    usual = float(np.median(depth[near]))
    return DepthAgainstPair(float(np.exp(np.median(ratio))), along, scale, offset, usual, float(high - low))


def _fitted(design: FloatArray, values: FloatArray) -> tuple[float, float]:
    """The two coefficients of a least-squares fit without outliers."""
    kept: BoolArray = np.ones(values.size, bool)
    for _ in range(ROUNDS):
        found = np.linalg.lstsq(design[kept], values[kept], rcond=None)[0]
        apart = np.abs(values - design @ found)
        kept = apart <= KEPT * np.median(apart)
    return float(found[0]), float(found[1])


def fit_findings(fit: DepthAgainstPair, has_baseline: bool, unit: str, where: str) -> list[Finding]:
    """The finding of a fit that is not that of a depth along the optical axis with the scale of the pair."""
    if fit.along_ray > ALONG_RAY:
        what = (
            "against the stereo pairs the depth grows towards the edges of the picture as distances along the ray do"
            f" (exponent {fit.along_ray:.2f}; 0 along the optical axis, 1 along the ray)"
        )
    elif abs(fit.offset) > OFFSET * fit.usual and fit.spread > FLAT * fit.usual:
        more = f"{abs(fit.offset):.3g} {unit} {'more' if fit.offset > 0 else 'less'} than"
        times = f"{fit.scale:.3g} times " if has_baseline else "a multiple of "
        what = f"the depth is {more} {times}that of the stereo pairs: an offset, or two unlike principal points"
    elif has_baseline and not 1 / SCALE < fit.ratio < SCALE:
        likely = next((said for factor, said in FACTORS if abs(np.log(fit.ratio / factor)) < np.log(SCALE) / 2), "")
        guess = f"; it looks like {likely}" if likely else ""
        what = f"the depth is {fit.ratio:.3g} times that of the stereo pairs{guess}"
    else:
        return []
    return [finding("depth-against-pair", where, what)]
