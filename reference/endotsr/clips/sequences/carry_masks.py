"""Instrument masks of a few key frames, carried to all frames by dense flow (specification: conventions, *Masks*).

A mask is carried from the key before and from the key after, frame by frame: with the flow b from frame i back to frame
i - 1, the mask of frame i is m_i(x) = m_{i-1}(x + b(x)), bilinear, and likewise from the other side. Instrument and
tissue move differently, and dense flow mixes the two motions at the edge. Within EDGE pixels of the instrument's
inside, the flow is therefore that of the inside: a Gaussian average over the eroded mask. Between keys a and b the two
sides are blended by time,

    c_i = (1 - s) m_i + s m'_i,   s = (i - a) / (b - a),

and the mask is c_i > 1/2. With a margin, it is c_i > 1/4, grown by `margin` pixels: in the middle between two keys one
side is enough, near a key the far side alone is not. A mask that is too large costs less than one that is too small.

Tissue that an instrument uncovers has no place in the frame before, where the flow of that side is wrong; the other
side knows it. A check of the flow there and back finds such pixels, and many others: on EndoNeRF pulling it lowers the
mean intersection over union from 0.94 to at most 0.91 with a key every five frames. It is not used.

The agreement of a frame is the intersection over union of the two sides. A frame below LEAST_AGREEMENT is not trusted
and is named. The frame to draw next lies where the sides disagree most.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from endotsr.clips.opencv import dense_flow, gaussian_blur, grown, warp_mask
from endotsr.clips.sequences.clip import Picture
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray

EDGE = 6.0  # px: distance from the inside of the instrument within which its own flow replaces the dense one
INSIDE = 2  # px by which the inside is smaller than the mask
SPREAD = 4.0  # px, standard deviation of the average of the flow inside
LEAST_PIXELS = 50  # a smaller inside has no flow of its own
LEAST_AGREEMENT = 0.5  # of the two sides; a guess: no frame of the two EndoNeRF clips is below, at 20 frames a key
LEAST_GAIN = 0.02  # of the agreement, averaged over the frames between two keys, that another key must promise


class Carried(NamedTuple):
    """Masks of all frames, with what is known of their quality."""

    excluded: list[BoolArray]  # (H, W) per frame, True = instrument
    agreement: list[float]  # per frame: intersection over union of the two sides; 1 at keys and where both are empty
    next_key: int | None  # frame whose mask would help most; None if the expected gain is below LEAST_GAIN

    @property
    def distrusted(self) -> list[int]:
        """Frames whose two sides disagree."""
        return [i for i, agreement in enumerate(self.agreement) if agreement < LEAST_AGREEMENT]


class ClipFlows(NamedTuple):
    """Dense flows between neighbouring frames, (2, H, W) px each."""

    forward: list[FloatArray]  # frame i -> frame i + 1
    backward: list[FloatArray]  # frame i + 1 -> frame i


def motion_of(pictures: Sequence[Picture]) -> ClipFlows:
    """The flows of a clip, pictures (H, W, 3) uint8 in time order; the expensive part, which no key changes."""
    planes = [np.ascontiguousarray(picture.transpose(2, 0, 1)) for picture in pictures]
    pairs = list(pairwise(planes))
    return ClipFlows([dense_flow(a, b) for a, b in pairs], [dense_flow(b, a) for a, b in pairs])


def carry_masks(motion: ClipFlows, keys: Mapping[int, BoolArray], margin: int = 0) -> Carried:
    """Masks of all frames from those of the key frames.

    motion    of `motion_of`
    keys      frame -> (H, W), True = instrument; a key may be empty or full
    margin    px by which the masks grow; above 0, the blend is cut at 1/4 in place of 1/2

    Edges:    before the first key and after the last one there is one side, whose agreement counts as 0, so that these
              frames are named.
    Raises:   InputError without keys, and for a key outside of the clip or of another size.
    """
    count = len(motion.forward) + 1
    _check_keys(keys, count, motion)
    order = sorted(keys)
    ahead = _carried(keys, motion.backward, range(count))
    back = _carried(keys, motion.forward, range(count - 1, -1, -1))
    masks, agreement = [], []
    for i in range(count):
        before = max((k for k in order if k <= i), default=None)
        after = min((k for k in order if k >= i), default=None)
        one, other = ahead.get(i), back.get(i)
        if one is None or other is None or before is None or after is None:
            soft = one if one is not None else other
            assert soft is not None
            masks.append(_excluded(soft, margin))
            agreement.append(0.0)
            continue
        s = (i - before) / (after - before) if after > before else 0.0
        masks.append(_excluded(np.float32(1 - s) * one + np.float32(s) * other, margin))
        agreement.append(1.0 if i in keys else _overlap(one > 0.5, other > 0.5))
    return Carried(masks, agreement, _next_key(agreement, order))


def _check_keys(keys: Mapping[int, BoolArray], count: int, motion: ClipFlows) -> None:
    if not keys:
        raise InputError("masks: no key frame is given; name at least one frame with its mask")
    for frame, mask in keys.items():
        if not 0 <= frame < count:
            raise InputError(f"masks: key frame {frame} is not a frame of the clip; use one of 0 to {count - 1}")
        if motion.forward and mask.shape != motion.forward[0].shape[1:]:
            height, width = motion.forward[0].shape[1:]
            raise InputError(f"masks: key {frame} is {mask.shape[1]}x{mask.shape[0]}, the pictures {width}x{height}")


def _carried(keys: Mapping[int, BoolArray], to_last: list[FloatArray], frames: range) -> dict[int, FloatArray]:
    """Frame -> soft mask carried from the last key on the way; frames before the first key are missing.

    to_last   flow between frames i and i + 1, from the frame that comes later on the way to the earlier one
    """
    found: dict[int, FloatArray] = {}
    for last, i in zip((None, *frames), frames):
        if i in keys:
            found[i] = keys[i].astype(np.float32)
        elif last is not None and last in found:
            found[i] = carried_once(found[last], to_last[min(last, i)])
    return found


def carried_once(mask: FloatArray, flow: FloatArray) -> FloatArray:
    """A soft mask (H, W) at the next frame; flow (2, H, W) px from that frame to the one of the mask."""
    moved = warp_mask(mask, flow)
    inside = ~grown(moved <= 0.5, INSIDE)
    if np.count_nonzero(inside) < LEAST_PIXELS:
        return moved
    weight = gaussian_blur(inside.astype(np.float32), SPREAD) + np.float32(1e-4)
    own = np.stack([gaussian_blur(axis * inside, SPREAD) / weight for axis in flow])
    edge = grown(inside, EDGE) & ~inside
    return np.where(edge, warp_mask(mask, np.where(edge, own, flow)), moved)


def _excluded(blend: FloatArray, margin: int) -> BoolArray:
    return blend > 0.5 if margin == 0 else grown(blend > 0.25, margin)


def _overlap(one: BoolArray, other: BoolArray) -> float:
    """Intersection over union; 1 if both are empty."""
    union = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / union if union else 1.0


def _next_key(agreement: list[float], keys: list[int]) -> int | None:
    """The frame to draw: in the gap that loses most agreement, where loss times distance to the nearer key is largest.

    Next to a key the two sides disagree because the other one comes from far, and a new key would help little.
    """
    ends = [-1, *keys, len(agreement)]
    gaps = [range(a + 1, b) for a, b in pairwise(ends) if b - a > 1]
    lost = [sum(1 - agreement[i] for i in gap) for gap in gaps]
    if not gaps or max(lost) < LEAST_GAIN * len(agreement):
        return None
    gap = gaps[int(np.argmax(lost))]
    if gap.start == 0:
        return 0
    if gap.stop == len(agreement):
        return len(agreement) - 1
    return max(gap, key=lambda i: ((1 - agreement[i]) * min(i - gap.start + 1, gap.stop - i), -i))
