"""Checks of the pictures: black, white, grey, repeated frames, jumps of the exposure, gaps in the numbers.

Comes in: one small `FrameFacts` a frame, so that a clip of any length fits; goes out: findings.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.sequences.checks.findings import Finding, finding
from endotsr.sequences.files import frame_numbers

SMALL = 8  # pixels between the sampled rows and columns
BLACK, WHITE = 6.0, 249.0  # mean grey level
SAME = 0.05  # mean difference in grey levels: two recorded frames differ by sensor noise of 0.5 and more
JUMP = 2.0  # ratio of the mean brightness of neighbouring frames; published clips stay within 1.15
CLIPPED = 0.3  # of the pixels of a frame at 255 in all channels


class FrameFacts(NamedTuple):
    """What is kept of a picture."""

    name: str
    small: NDArray[np.int16]  # (h, w, 3) every eighth pixel
    clipped: float  # fraction at full white


def frame_facts(name: str, picture: NDArray[np.uint8]) -> FrameFacts:
    """The facts of a picture (H, W, 3)."""
    step = max(1, min(SMALL, min(picture.shape[:2]) // 8))
    small = picture[::step, ::step].astype(np.int16)
    return FrameFacts(name, small, float((small == 255).all(axis=2).mean()))


def frame_findings(facts: list[FrameFacts], where: str) -> list[Finding]:
    """Findings on the pictures of a sequence, in time order."""
    means = np.array([float(fact.small.mean()) for fact in facts])
    found = [kind for i, fact in enumerate(facts) for kind in _of_frame(fact, float(means[i]), where, i)]
    readable = (means >= BLACK) & (means <= WHITE)
    for i in range(1, len(facts)):
        if readable[i - 1] and readable[i] and facts[i].small.shape == facts[i - 1].small.shape:
            found += _of_neighbours(facts[i - 1], facts[i], float(means[i] / means[i - 1]), where, i)
    if facts and all((fact.small == fact.small[:, :, :1]).all() for fact in facts):
        found.append(finding("grey-pictures", where, "every picture is grey"))
    return found


def _of_frame(fact: FrameFacts, mean: float, where: str, i: int) -> list[Finding]:
    """A frame without a picture, or without colour in much of it."""
    if mean < BLACK:
        return [finding("black-frame", where, f"{fact.name} is black (mean {mean:.1f} of 255)", i)]
    if mean > WHITE:
        return [finding("white-frame", where, f"{fact.name} is white (mean {mean:.1f} of 255)", i)]
    if fact.clipped > CLIPPED:
        return [finding("clipped-frame", where, f"{fact.name}: {fact.clipped:.0%} of it is fully white", i)]
    return []


def _of_neighbours(before: FrameFacts, fact: FrameFacts, ratio: float, where: str, i: int) -> list[Finding]:
    """A repeated frame, a jump of the brightness; `ratio` is that of the means."""
    found = []
    if np.abs(fact.small - before.small).mean() < SAME:
        found.append(finding("duplicated-frame", where, f"{fact.name} repeats {before.name}", i))
    if not 1 / JUMP < ratio < JUMP:
        found.append(finding("exposure-jump", where, f"brightness changes by {ratio:.2f} times", i))
    return found


def gap_findings(files: list[Path]) -> list[Finding]:
    """Numbers that are missing between the frames, as after a frame was deleted or not decoded."""
    numbers = frame_numbers(files)
    if numbers is None or len(files) < 3 or len(numbers[0]) != 1:
        return []
    steps = np.diff([number[0] for number in numbers])
    usual = int(np.median(steps))
    wide = np.flatnonzero(steps != usual)
    if not wide.size:
        return []
    i = int(wide[0])
    what = f"{wide.size} gaps in the numbers; the first is between {files[i].name} and {files[i + 1].name}"
    return [finding("number-gap", files[0].parent, what, i + 1)]
