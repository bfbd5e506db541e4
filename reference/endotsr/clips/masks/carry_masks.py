"""Instrument masks of a few key frames, carried to all frames by dense flow (specification: conventions, *Masks*).

A mask is carried from the key before and from the key after, frame by frame: with the flow b from frame i back to frame
i - 1, the mask of frame i is m_i(x) = m_{i-1}(x + b(x)), bilinear, and likewise from the other side. Instrument and
tissue move differently, and dense flow mixes the two motions at the edge. Within EDGE pixels of the instrument's
inside, the flow is therefore that of the inside: a Gaussian average over the eroded mask. Between keys a and b the two
sides are blended by time,

    c_i = (1 - s) m_i + s m'_i,   s = (i - a) / (b - a),

and the mask is c_i > 1/2. With a margin, it is c_i >= 1/4, grown by `margin` pixels. Blends are stored in steps of
1/255, and compared after rounding. In the middle between two keys one
side is enough, near a key the far side alone is not. A mask that is too large costs less than one that is too small.

Tissue that an instrument uncovers has no place in the frame before, where the flow of that side is wrong; the other
side knows it. A check of the flow there and back finds such pixels, and others: in a trial on EndoNeRF pulling, of
which no record is kept, it lowered the mean intersection over union. It is not used.

The agreement of a frame is the intersection over union of the two sides. A frame below LEAST_AGREEMENT is not trusted
and is named. The frame to draw next lies in the gap between keys that loses most agreement, where the sides disagree
far from both keys. Its expected gain is that loss, averaged over all frames: what a perfect gap would add to the mean
agreement. Below LEAST_GAIN no frame is named.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.flow.clip_flows import ClipFlows
from endotsr.clips.opencv.filters import gaussian_blur
from endotsr.clips.opencv.flow import warp_mask
from endotsr.clips.opencv.regions import grown_by_disc
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.untrusted.files import in_threads

EDGE = 6.0  # px: distance from the inside of the instrument within which its own flow replaces the dense one
INSIDE = 2  # px by which the inside is smaller than the mask
SPREAD = 4.0  # px, standard deviation of the average of the flow inside
REACH = 24  # px, at least EDGE and the half width of the average, 4 SPREAD
LEAST_PIXELS = 50  # a smaller inside has no flow of its own
LEAST_AGREEMENT = 0.5  # of the two sides; a guess: no frame of the two EndoNeRF clips is below, at 20 frames a key
LEAST_GAIN = 0.02  # of the mean agreement of all frames, that another key must promise


class Carried(NamedTuple):
    """Masks of all frames, with what is known of their quality."""

    excluded: list[BoolArray]  # (H, W) per frame, True = instrument
    agreement: list[float]  # per frame: intersection over union of the two sides; 1 at keys and where both are empty
    next_key: int | None  # frame whose mask would help most; None if the expected gain is below LEAST_GAIN
    gain: float  # expected gain of the mean agreement from the mask of the best frame, at most

    @property
    def distrusted(self) -> list[int]:
        """Frames whose two sides disagree."""
        return [i for i, agreement in enumerate(self.agreement) if agreement < LEAST_AGREEMENT]


class CarriedGap(NamedTuple):
    """The frames between two keys, or between a key and an end of the clip, without the keys."""

    blend: list[NDArray[np.uint8]]  # (H, W) 255 times the blend c_i of both sides
    agreement: list[float]


Gaps = dict[tuple[int, int], CarriedGap]  # (key before or -1, key after or number of frames) -> its frames


def carry_masks(
    motion: ClipFlows, keys: Mapping[int, BoolArray], margin: int = 0, known: Gaps | None = None
) -> Carried:
    """Masks of all frames from those of the key frames.

    motion    of `motion_of`
    keys      frame -> (H, W), True = instrument; a key may be empty or full
    margin    px by which the masks grow; above 0, the blend is cut at 1/4 in place of 1/2
    known     gaps of an earlier call with equal masks, to which those of this call are added: a further key costs the
              time of its own gap

    Edges:    before the first key and after the last one there is one side, whose agreement counts as 0, so that these
              frames are named.
    Raises:   InputError without keys, and for a key outside of the clip or of another size.
    """
    count, gaps = len(motion.forward) + 1, {} if known is None else known
    _check_keys(keys, count, motion)
    masks, agreement, lost = [], [], []
    ends = [-1, *sorted(keys), count]
    missing = [gap for gap in pairwise(ends) if gap not in gaps]
    in_threads(lambda i: gaps.update({missing[i]: _gap(motion, keys, *missing[i])}), len(missing))
    for before, after in pairwise(ends):
        gap = gaps[before, after]
        masks += [_excluded(blend, margin) for blend in gap.blend]
        agreement += gap.agreement
        lost.append(sum(1 - value for value in gap.agreement))
        if after < count:
            masks.append(_excluded(_levels(keys[after]), margin))
            agreement.append(1.0)
    widest = int(np.argmax(lost))
    gain = lost[widest] / count
    best = _best_frame(agreement, ends[widest], ends[widest + 1], count) if gain >= LEAST_GAIN else None
    return Carried(masks, agreement, best, gain)


def _gap(motion: ClipFlows, keys: Mapping[int, BoolArray], before: int, after: int) -> CarriedGap:
    """The frames between two keys; -1 and the number of frames stand for the ends of the clip."""
    frames = range(before + 1, after)
    ahead = _carried(keys[before], motion.backward, frames, 1) if before in keys else []
    back = _carried(keys[after], motion.forward, frames[::-1], 0)[::-1] if after in keys else []
    if not ahead or not back:
        return CarriedGap([_levels(soft) for soft in ahead or back], [0.0] * len(frames))
    weights = [np.float32((i - before) / (after - before)) for i in frames]
    blend = [_levels((1 - s) * one + s * other) for s, one, other in zip(weights, ahead, back)]
    return CarriedGap(blend, [overlap_of(one > 0.5, other > 0.5) for one, other in zip(ahead, back)])


def _check_keys(keys: Mapping[int, BoolArray], count: int, motion: ClipFlows) -> None:
    if not keys:
        raise InputError("masks: no key frame is given; name at least one frame with its mask")
    for frame, mask in keys.items():
        if not 0 <= frame < count:
            raise InputError(f"masks: key frame {frame} is not a frame of the clip; use one of 0 to {count - 1}")
        if motion.forward and mask.shape != motion.forward[0].shape[1:]:
            height, width = motion.forward[0].shape[1:]
            raise InputError(f"masks: key {frame} is {mask.shape[1]}x{mask.shape[0]}, the pictures {width}x{height}")


def _carried(mask: BoolArray, to_last: Sequence[FloatArray], frames: range, lag: int) -> list[FloatArray]:
    """Soft masks of the frames on the way from a key.

    to_last   flows between neighbouring frames, from the one that comes later on the way to the earlier one
    lag       entry i - lag belongs to frame i
    """
    soft, found = mask.astype(np.float32), []
    for i in frames:
        soft = carried_once(soft, to_last[i - lag])
        found.append(soft)
    return found


def carried_once(mask: FloatArray, flow: FloatArray) -> FloatArray:
    """A soft mask (H, W) at the next frame; flow (2, H, W) px from that frame to the one of the mask."""
    moved = np.zeros_like(mask)
    if not mask.any():
        return moved
    near = _around(mask > 0, math.ceil(max(flow.max(), -flow.min())) + 1)  # the others take a 0 from where they point
    moved[near] = warp_mask(mask, flow[:, *near], near)
    place = _around(moved > 0.5, REACH)
    inside = ~grown_by_disc(moved[place] <= 0.5, INSIDE)
    if np.count_nonzero(inside) < LEAST_PIXELS:
        return moved
    weight = gaussian_blur(inside.astype(np.float32), SPREAD) + np.float32(1e-4)
    edge, own = grown_by_disc(inside, EDGE) & ~inside, flow[:, *place].copy()
    for axis in own:
        axis[edge] = (gaussian_blur(axis * inside, SPREAD) / weight)[edge]
    moved[place][edge] = warp_mask(mask, own, place)[edge]
    return moved


def _around(mask: BoolArray, reach: int) -> tuple[slice, slice]:
    """Rows and columns of the pixels of a mask and of all at most `reach` px from them; empty for an empty mask."""
    found = [np.flatnonzero(mask.any(axis=1 - axis)) for axis in (0, 1)]
    rows, columns = (slice(max(0, at[0] - reach), at[-1] + reach + 1) if at.size else slice(0) for at in found)
    return rows, columns


def _levels(blend: FloatArray | BoolArray) -> NDArray[np.uint8]:
    return (blend * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def _excluded(levels: NDArray[np.uint8], margin: int) -> BoolArray:
    # 128 is a blend of exactly 1/2: half-way between two keys, a pixel of one side alone.
    return levels > 128 if margin == 0 else grown_by_disc(levels >= 64, margin)


def overlap_of(one: BoolArray, other: BoolArray) -> float:
    """Intersection over union; 1 if both are empty."""
    union = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / union if union else 1.0


def _best_frame(agreement: list[float], before: int, after: int, count: int) -> int:
    """The frame of a gap to draw: where the lost agreement times the distance to the nearer key is largest.

    Next to a key the two sides disagree because the other one comes from far, and a new key would help little.
    """
    if before < 0:
        return 0
    if after == count:
        return count - 1
    return max(range(before + 1, after), key=lambda i: ((1 - agreement[i]) * min(i - before, after - i), -i))
