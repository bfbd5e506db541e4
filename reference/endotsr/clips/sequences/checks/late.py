"""Masks and depth of other moments than their pictures: all of them late or early by about the same number of frames.

In: pictures, tissue and depth of a clip, one frame at a time. Out: findings. What the masks exclude has other colours
than tissue. The shift k with the largest mutual information of the colour of a pixel in frame t and its mask in frame
t + k is taken for the lag of the masks. An excluded area that grows, as where an instrument enters, may favour another
shift. The pixels whose mask the shift changes have to agree:

    gain(k) = mean of s l over the pixels p of all frames t with m(p, t + k) != m(p, t)
    l = log (part of the tissue pixels that have the colour of (p, t) / part of the excluded pixels that have it)
    s = 1 where m(p, t + k) is tissue, else -1

Depth that is missing where the masks exclude shows its moment by its holes. Masks and depth in reversed order are found
in the same two ways.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.sampling import sampling_step, small_picture
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.untrusted.names import counted

FARTHEST, LONGEST, FEWEST = 8, 600, 8  # frames: largest shift; of a clip, from its start; between the largest shifts
SHIFTS = range(-FARTHEST, FARTHEST + 1)
LEVELS, MOST = 8, 3.0  # of a colour channel; largest |l|
# Shortest shift of a finding, its gain, and the part of the frames with a gain above 0. The masks of the two EndoNeRF
# clips fit best at 0 and -1, there with 0.03 in 0.54 of the frames. Late by 3, 5 and 7 frames they fit best at 2 to 7,
# with gains of 0.22 to 0.79 in 0.74 to 0.91 of the frames.
SHORTEST, GAIN, AGREEING = 2, 0.1, 0.6
LEAST_CHANGED = 1e-3  # part of the pixels that the shifted masks change
# Mutual information that the shift gains: nats, and times that of the masks as they are. Parts of two recorded and of
# three simulated clips, in time and in the picture, gain up to 0.008, or 1.034 times, at a wrong shift. With masks that
# are moved by five frames, four of five of these parts exceed both limits. In reversed order, masks tell up to 1.01
# times as much as they are, and at most 0.87 times where an instrument moves.
INFORMED, TIMES, NOTHING = 0.009, 1.04, 1e-6
APART, BETTER = 0.005, 3.0  # part of the pixels where holes and masks differ; times that of the best shift


class LateParts:
    """The colours, masks and holes of the first frames of a clip, at every eighth pixel, from one pass over them."""

    def __init__(self) -> None:
        self._colours: list[NDArray[np.intp]] = []
        self._tissue: list[BoolArray] = []
        self._known: list[BoolArray] = []
        self._open = True  # until a frame has no mask, or another size

    def add(self, picture: NDArray[np.uint8], tissue: BoolArray | None, depth: NDArray[np.float32] | None) -> None:
        """The next frame: picture (H, W, 3); tissue (H, W) and depth (H, W), 0 = none, or None where there is none."""
        small, step = small_picture(picture), sampling_step(picture)
        usual = self._colours[0].shape if self._colours else small.shape[:2]
        self._open = self._open and tissue is not None and usual == small.shape[:2] and len(self._colours) < LONGEST
        if not self._open or tissue is None:
            return
        levels = (small // (256 // LEVELS)).astype(np.intp)
        self._colours.append(levels @ np.array([LEVELS**2, LEVELS, 1]))
        self._tissue.append(tissue[::step, ::step])
        if depth is not None:
            self._known.append(depth[::step, ::step] > 0)

    def findings(self, masks: str, depth: str) -> list[Finding]:
        """Warnings on late or early masks, and on depth whose holes are late or early. masks, depth: their folders."""
        if len(self._tissue) < 2 * FARTHEST + FEWEST:
            return []
        tissue, colours = np.stack(self._tissue), np.stack(self._colours)
        found = masks_of_other_frames(colours, tissue, masks)
        return found or (late_depth(np.stack(self._known), tissue, depth) if len(self._known) == len(tissue) else [])


def loaded_late_findings(sequence: Sequence, masks: str, depth: str) -> list[Finding]:
    """`LateParts.findings` of a sequence in memory."""
    parts = LateParts()
    for i in range(sequence.count):
        parts.add(sequence.picture(i), sequence.masks[i], sequence.depth[i])
    return parts.findings(masks, depth)


def masks_of_other_frames(colours: NDArray[np.intp], tissue: BoolArray, where: str) -> list[Finding]:
    """A warning on masks that fit the pictures of other frames better: moved by some frames, or the last one first.

    colours   (n, h, w) numbers of quantised colours
    tissue    (n, h, w)

    Of the two, what tells more of the colours; of an instrument that enters, late masks and reversed ones look alike.
    """
    late, turned = late_masks(colours, tissue, where), reversed_masks(colours, tissue, where)
    if not (late and turned):
        return late or turned
    middle = slice(FARTHEST, len(tissue) - FARTHEST)
    moved = max(mutual_information(colours[middle], moved) for moved in _moved(tissue).values())
    return turned if mutual_information(colours[middle], tissue[::-1][middle]) > moved else late


def _moved(tissue: BoolArray) -> dict[int, BoolArray]:
    """By shift, the masks that it gives the frames in the middle."""
    return {k: tissue[FARTHEST + k : len(tissue) - FARTHEST + k] for k in SHIFTS}


def late_masks(colours: NDArray[np.intp], tissue: BoolArray, where: str) -> list[Finding]:
    """A warning on masks that fit the pictures some frames before or after better; see `masks_of_other_frames`."""
    middle = slice(FARTHEST, len(tissue) - FARTHEST)
    moved = _moved(tissue)
    known = {k: mutual_information(colours[middle], moved[k]) for k in SHIFTS}
    best = max(SHIFTS, key=lambda k: known[k])
    if abs(best) < SHORTEST or known[best] < max(known[0] + INFORMED, TIMES * known[0]):
        return []
    gains, changed = _gain(colours[middle], moved[0], moved[best])
    if changed.sum() < LEAST_CHANGED * moved[0].size or gains.sum() < GAIN * changed.sum():
        return []
    if np.mean(gains[changed > 0] > 0) < AGREEING:
        return []
    what = (
        f"the masks seem to be about {lag_in_words(best)}: moved so, they tell"
        f" {known[best] / max(known[0], NOTHING):.2f} times as much of the colours of the pictures (limit {TIMES})"
    )
    return [finding("late-masks", where, what)]


def reversed_masks(colours: NDArray[np.intp], tissue: BoolArray, where: str) -> list[Finding]:
    """A warning on masks that fit the pictures better from the last to the first; see `masks_of_other_frames`."""
    known, turned = (mutual_information(colours, masks) for masks in (tissue, tissue[::-1]))
    if turned < max(known + INFORMED, TIMES * known):
        return []
    gains, changed = _gain(colours, tissue, tissue[::-1])
    if np.mean(gains[changed > 0] > 0) < AGREEING:
        return []
    what = (
        "the masks seem to be in reversed order: the last one first, they tell"
        f" {turned / max(known, NOTHING):.2f} times as much of the colours of the pictures (limit {TIMES})"
    )
    return [finding("late-masks", where, what)]


def late_depth(known: BoolArray, tissue: BoolArray, where: str) -> list[Finding]:
    """A warning on depth whose holes follow the masks of other frames; known, tissue: (n, h, w)."""
    middle = slice(FARTHEST, len(tissue) - FARTHEST)
    apart = {k: float(np.mean(known[FARTHEST + k : len(known) - FARTHEST + k] != tissue[middle])) for k in SHIFTS}
    best = min(apart, key=lambda k: (apart[k], abs(k)))
    turned = float(np.mean(known[::-1] != tissue))
    if turned < apart[best] and apart[0] >= max(APART, BETTER * turned):
        what = (
            f"its holes differ from the masks in {apart[0]:.1%} of the pixels, and in {turned:.1%} the last one first"
        )
        return [finding("late-depth", where, f"the depth seems to be in reversed order: {what}")]
    if best == 0 or apart[0] < APART or apart[0] < BETTER * apart[best]:
        return []
    what = (
        f"the depth seems to be {lag_in_words(best)}: its holes differ from the masks in {apart[0]:.1%} of the pixels,"
        f" and in {apart[best]:.1%} if moved so"
    )
    return [finding("late-depth", where, what)]


def mutual_information(colours: NDArray[np.intp], tissue: BoolArray) -> float:
    """Of the colour and the mask of a pixel, nats."""
    joint = np.stack([np.bincount(colours[part], minlength=LEVELS**3) for part in (tissue, ~tissue)]) / colours.size
    independent = joint.sum(axis=0) * joint.sum(axis=1, keepdims=True)
    seen = joint > 0
    return float(np.sum(joint[seen] * np.log(joint[seen] / independent[seen])))


def _gain(colours: NDArray[np.intp], tissue: BoolArray, moved: BoolArray) -> tuple[FloatArray, FloatArray]:
    """For each frame: the sum of s l over the pixels that the moved masks change, and their number.

    l is that of the moved masks, limited to MOST.
    """
    count, other = (np.bincount(colours[part], minlength=LEVELS**3) + 1.0 for part in (moved, ~moved))
    likely = np.clip(np.log(count / count.sum()) - np.log(other / other.sum()), -MOST, MOST)[colours]
    changed = moved != tissue
    signed = np.where(changed, np.where(moved, likely, -likely), 0.0)
    return signed.sum(axis=(1, 2)), changed.sum(axis=(1, 2), dtype=np.float64)


def lag_in_words(frames: int) -> str:
    """`3 frames late`, or `1 frame early` for -1."""
    return f"{counted(abs(frames), 'frame')} {'late' if frames > 0 else 'early'}"
