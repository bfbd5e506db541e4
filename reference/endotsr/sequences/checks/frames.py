"""Checks of the pictures: black, white, grey, repeated frames, jumps of the exposure, gaps in the numbers.

Comes in: one small `FrameFacts` a frame, so that a clip of any length fits; goes out: findings.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.sequences.checks.findings import Finding
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
    found = []
    for i, fact in enumerate(facts):
        if means[i] < BLACK:
            found.append(
                _finding(
                    "black-frame",
                    where,
                    i,
                    f"{fact.name} is black (mean {means[i]:.1f} of 255)",
                    "a black frame teaches the model a black scene at its time",
                )
            )
        elif means[i] > WHITE:
            found.append(
                _finding(
                    "white-frame",
                    where,
                    i,
                    f"{fact.name} is white (mean {means[i]:.1f} of 255)",
                    "a white frame teaches the model a white scene at its time",
                )
            )
        elif fact.clipped > CLIPPED:
            found.append(
                _finding(
                    "clipped-frame",
                    where,
                    i,
                    f"{fact.name}: {fact.clipped:.0%} of it is fully white",
                    "colour is lost there",
                )
            )
    dark = (means < BLACK) | (means > WHITE)
    for i in range(1, len(facts)):
        if dark[i] or dark[i - 1] or facts[i].small.shape != facts[i - 1].small.shape:
            continue
        if np.abs(facts[i].small - facts[i - 1].small).mean() < SAME:
            found.append(
                _finding(
                    "duplicated-frame",
                    where,
                    i,
                    f"{facts[i].name} repeats {facts[i - 1].name}",
                    "a held-out frame that repeats a training frame makes the metrics too good, and time"
                    " stands still there",
                )
            )
        ratio = means[i] / means[i - 1]
        if not 1 / JUMP < ratio < JUMP:
            found.append(
                Finding(
                    "warning",
                    "exposure-jump",
                    where,
                    i,
                    f"brightness changes by {ratio:.2f} times",
                    "the colour of the tissue follows the camera there",
                    "fit exposures (model.exposure = true), or cut the clip with --frames",
                )
            )
    if facts and all((fact.small == fact.small[:, :, :1]).all() for fact in facts):
        found.append(
            Finding(
                "note",
                "grey-pictures",
                where,
                None,
                "every picture is grey",
                "polarity cannot be checked by colour",
                "none needed",
            )
        )
    return found


def _finding(code: str, where: str, frame: int, what: str, why: str) -> Finding:
    return Finding("warning", code, where, frame, what, why, "leave the frame out (prepare --frames, or delete it)")


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
    return [
        Finding(
            "warning",
            "number-gap",
            str(files[0].parent),
            i + 1,
            f"{wide.size} gaps in the numbers; the first is between {files[i].name} and {files[i + 1].name}",
            "frames count as evenly spaced in time",
            "supply the missing frames, or cut the clip there",
        )
    ]
