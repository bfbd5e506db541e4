"""Frames that repeat another one: the one before, exactly or in a pattern up to the noise of coding, or an earlier one.

A recorder that stores 15 pictures a second as 30 writes each twice, a conversion from 24 to 30 repeats every fifth.
After coding, a copy differs a little, and the pattern tells it from a pause of the motion. A clip that is joined to
itself, or played back and forth, shows its pictures again. In: small pictures of the frames. Out: the copies, findings,
and a split in which no copy of a held-out frame is trained on.
"""

from hashlib import blake2b
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.splits import LEAST_TRAINING_FRAMES
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray, IndexArray

SAME = 0.05  # mean difference in grey levels; sensor noise makes recorded frames differ by 0.5 or more
LONGEST = 6  # frames of a pattern: 25 frames a second stored as 30
CYCLES = 4  # patterns that a clip holds at least
# Median step to a copy, of that to another picture: without loss or with little; and after lossy coding, where at most
# half of the frames are copies. Parts of 12 clips, also every second or third frame, have no such pattern; where the
# exposure jumps every five frames, most of the frames differ little.
COPY, CODED = 0.25, 0.5
# Distance of a picture from the mean of its neighbours, of half their distance: the median of every second picture, and
# relative to that of the others. Parts of the clips have 0.59 and 0.79 or more, blended pictures without loss 0.30 and
# 0.22 or less. After JPEG of quality 90 they have up to 0.75 and 0.61, and no limit tells them from others.
BLENDED, BY_TURNS, FEWEST = 0.45, 0.4, 10
APART = 0.9  # of the steps to copies that are below this part of the steps to other pictures


class Pattern(NamedTuple):
    """Every `period` frames, those at `places` repeat the frame before."""

    period: int
    places: tuple[int, ...]  # frame number modulo the period
    copied: float  # median step to a copy, grey levels
    moved: float  # median step to another picture

    @property
    def frames(self) -> str:
        """The frames without copies, as --frames takes them."""
        kept = [place for place in range(self.period) if place not in self.places]
        return ",".join(f"{place or ''}::{self.period}" for place in kept)


def steps_between(small: list[np.ndarray]) -> FloatArray:
    """(n - 1,) mean difference of each picture from the one before, grey levels; NaN between unlike sizes.

    small   pictures (h, w, 3) of the frames
    """
    return np.array([np.abs(b - a).mean() if a.shape == b.shape else np.nan for a, b in pairwise(small)])


def pattern_of(steps: FloatArray) -> Pattern | None:
    """The shortest pattern of copies in the steps between frames; None without one."""
    for period in range(2, LONGEST + 1):
        if len(steps) + 1 < CYCLES * period or not np.isfinite(steps).all():
            return None
        at = [steps[(place - 1) % period :: period] for place in range(period)]  # step i leads to frame i + 1
        medians = np.array([np.median(values) for values in at])
        small = medians < CODED * medians.max()
        if small.sum() > period / 2:
            small = medians < COPY * medians.max()
        if not small.any() or medians.max() < SAME:
            continue
        copied, moved = (np.concatenate([v for v, is_small in zip(at, small) if is_small == one]) for one in (1, 0))
        if np.quantile(copied, APART) < np.quantile(moved, 1 - APART):
            places = tuple(int(place) for place in np.flatnonzero(small))
            return Pattern(period, places, float(np.median(copied)), float(np.median(moved)))
    return None


def copied_frames(steps: FloatArray) -> BoolArray:
    """(n,) whether a frame repeats the one before."""
    found = np.concatenate([[False], steps < SAME])
    pattern = pattern_of(steps)
    if pattern is not None:
        found |= np.isin(np.arange(len(found)) % pattern.period, pattern.places)
        found[0] = False
    return found


def picture_numbers(small: list[np.ndarray], copies: BoolArray) -> IndexArray:
    """(n,) a number for each picture that the clip shows: frames with one number are copies of each other.

    copies   (n,) from `copied_frames`

    A frame that is equal to an earlier one in every value, as pictures without loss are, has its number too.
    """
    numbers: IndexArray = np.cumsum(~copies, dtype=np.intp)
    first = dict[bytes, int]()
    for i, picture in enumerate(small):
        number = first.setdefault(_digest(picture), int(numbers[i]))
        if number != numbers[i]:
            numbers[numbers == numbers[i]] = number
    return numbers


def _digest(picture: np.ndarray) -> bytes:
    """Equal for equal pictures, in place of their copies in memory."""
    return blake2b(repr(picture.shape).encode() + picture.tobytes(), digest_size=16).digest()


def return_finding(
    small: list[np.ndarray], steps: FloatArray, names: list[str], readable: BoolArray, where: str
) -> list[Finding]:
    """A warning on frames that repeat an earlier one, but not the one before.

    steps      from `steps_between`
    readable   frames that are neither black nor white
    """
    first, pairs = dict[bytes, int](), []
    for i, picture in enumerate(small):
        earlier = first.setdefault(_digest(picture), i)
        if readable[i] and earlier < i and (steps[earlier:i] >= SAME).any():
            pairs.append((i, earlier))
    if not pairs:
        return []
    frame, earlier = pairs[0]
    many = "1 frame repeats" if len(pairs) == 1 else f"{len(pairs)} of {len(names)} frames repeat"
    what = f"{many} an earlier one, after other pictures; the first is {names[frame]}, which repeats {names[earlier]}"
    return [finding("returning-frames", where, what, frame)]


def copy_findings(steps: FloatArray, names: list[str], readable: BoolArray, where: str) -> list[Finding]:
    """One warning on a pattern of copies, or one on every frame that repeats the one before exactly.

    steps      from `steps_between`
    readable   frames that are neither black nor white
    """
    pattern = pattern_of(steps)
    if pattern is not None and readable.all():
        count = int(copied_frames(steps).sum())
        every = "every second frame repeats" if pattern.period == 2 else (
            f"{len(pattern.places)} of every {pattern.period} frames repeat"
        )  # fmt: skip
        what = (
            f"{every} the one before ({count} of {len(names)} frames; they differ by {pattern.copied:.2f} grey levels,"
            f" other neighbours by {pattern.moved:.2f}); without the copies: --frames {pattern.frames}"
        )
        return [finding("repeated-frames", where, what)]
    frames = [i for i in range(1, len(names)) if steps[i - 1] < SAME and readable[i - 1] and readable[i]]
    return [finding("duplicated-frame", where, f"{names[i]} repeats {names[i - 1]}", i) for i in frames]


def blended_finding(small: list[np.ndarray], steps: FloatArray, readable: BoolArray, where: str) -> list[Finding]:
    """A warning on pictures of which every second one is the mean of its neighbours.

    steps      from `steps_between`
    readable   frames that are neither black nor white
    """
    if len(small) < FEWEST or not (readable.all() and np.isfinite(steps).all() and (steps > SAME).all()):
        return []
    grey = [picture.astype(np.float32) for picture in small]
    threes = zip(grey, grey[1:], grey[2:])
    apart = [2 * np.abs(b - (a + c) / 2).mean() / max(np.abs(c - a).mean(), SAME) for a, b, c in threes]
    odd, even = (float(np.median(apart[first::2])) for first in (0, 1))  # of the frames 1, 3, ... and 2, 4, ...
    less, more = sorted((odd, even))
    if less > BLENDED or less > BY_TURNS * more:
        return []
    kept = "::2" if odd < even else "1::2"
    what = (
        f"every second picture is the mean of its neighbours (its distance from it is {less:.2f} of half their"
        f" distance, that of the others {more:.2f}); without them: --frames {kept}"
    )
    return [finding("blended-frames", where, what)]


def without_twins(
    train: IndexArray, test: IndexArray, pictures: IndexArray, names: list[str], where: object
) -> tuple[IndexArray, list[str]]:
    """The training frames of which no held-out frame is a copy or the original, and a note.

    pictures   (n,) from `picture_numbers`

    Raises:  InputError if fewer than two training frames remain.
    """
    twins = np.isin(pictures[train], pictures[test])
    if not twins.any():
        return train, []
    kept = train[~twins]
    if len(kept) < LEAST_TRAINING_FRAMES:
        raise InputError(
            f"{where}: all but {len(kept)} training frames are copies of held-out frames; use a clip without the"
            " copies (`endotsr check` names them), or another split"
        )
    left = [names[i] for i in train[twins].tolist()]
    return kept, [f"{len(left)} frames are not trained on, because held-out frames repeat them: {shortened(left)}"]
