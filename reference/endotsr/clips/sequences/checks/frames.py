"""Checks of the pictures: black, white, grey and repeated frames, exposure jumps, gaps in the frame numbers.

In: one small `FrameFacts` per frame, for clips of any length. Out: findings.
"""

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import frame_numbers, shortened
from endotsr.clips.formats.picture_fields import colours_differ
from endotsr.clips.sequences.checks.blurred import blurred_findings, sharpness
from endotsr.clips.sequences.checks.clock_names import clock_findings
from endotsr.clips.sequences.checks.colours import colour_findings
from endotsr.clips.sequences.checks.copies import SAME, blended_finding, copy_findings, return_finding, steps_between
from endotsr.clips.sequences.checks.exchanged import exchanged_findings
from endotsr.clips.sequences.checks.frame_order import order_findings
from endotsr.clips.sequences.checks.halves import halves_finding
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.checks.light import light_findings
from endotsr.clips.sequences.checks.scenes import alternating_finding, cut_findings
from endotsr.clips.sequences.sampling import small_picture
from endotsr.clips.sequences.times import evenly_spaced, usual_rate
from endotsr.untrusted.names import counted

BLACK, WHITE = 6.0, 249.0  # mean grey level
FROZEN = 0.5  # as SAME, from the first frame of a clip to any other; encoders refine a still picture
WOVEN, PART = 1.15, 0.3  # of `FrameFacts.comb`, above which a picture is interlaced; part of the pictures
ACROSS = 1.3  # of `comb_across`: at most 0.61 on four clips, 1.21 in small noise, 9 in two views of pulling by columns
LEAST_ROWS = 16
# Ratio of the mean brightness of neighbouring frames: at most 1.05 on five recorded clips, 1.20 on simulated ones with
# exposures that jump, and 1.23 on every second or third of their frames and parts of them.
JUMP = 1.4
FLAT = 4  # grey levels between the darkest and the brightest pixel of a channel: a frame of one colour
NOTHING = 0.5  # of the frames; a clip with more black, white or one-coloured frames shows nothing
BLUE = 20.0  # grey levels of blue above red; in two public clips red is 30 and 47 above blue
SLOWEST, FASTEST = 0.1, 1000.0  # frames a second of a camera, time-lapse and high-speed recordings included
CLIPPED = 0.3  # of the pixels of a frame at 255 in all channels


class FrameFacts(NamedTuple):
    """Facts on a picture."""

    name: str
    small: NDArray[np.int16]  # (h, w, 3) every eighth pixel
    clipped: float  # fraction at full white
    comb: float  # difference of neighbouring rows relative to rows two apart
    comb_across: float = 0.0  # the same of columns
    fine: tuple[float, float] = (0.0, 0.0)  # see `blurred`: of rows, of columns


def frame_facts(name: str, picture: NDArray[np.uint8]) -> FrameFacts:
    """The facts on a picture (H, W, 3)."""
    small = small_picture(picture)
    clipped = float((small == 255).all(axis=2).mean())
    (comb, fine), (across, fine_across) = _comb(picture), _comb(picture.transpose(1, 0, 2))
    return FrameFacts(name, small, clipped, comb, across, (fine, fine_across))


def _comb(picture: NDArray[np.uint8]) -> tuple[float, float]:
    """Comb and fine detail (see `blurred`) of the rows; 0 for a picture with few rows or without detail.

    The comb is the mean difference between a row and its two neighbours, relative to rows two apart. Progressive
    pictures have 0.5 to 0.8, pure noise 1, and interlaced pictures 1.1 to 2.3: their even and odd rows show different
    times.
    """
    if picture.shape[0] < LEAST_ROWS:
        return 0.0, 0.0
    rows = picture[:, ::2].sum(axis=2, dtype=np.float32)
    near = np.abs(rows[2:-2] - (rows[1:-3] + rows[3:-1]) / 2).mean()
    far = np.abs(rows[2:-2] - (rows[:-4] + rows[4:]) / 2).mean()
    return (float(near / far) if far > 0 else 0.0), sharpness(float(near), float(rows.mean()))


def frame_findings(facts: list[FrameFacts], where: str) -> list[Finding]:
    """Findings on the pictures of a sequence, in time order."""
    means = np.array([float(fact.small.mean()) for fact in facts])
    found = [kind for i, fact in enumerate(facts) for kind in _of_frame(fact, float(means[i]), where, i)]
    readable = (means >= BLACK) & (means <= WHITE)
    steps = steps_between([fact.small for fact in facts])
    names = [fact.name for fact in facts]
    found += copy_findings(steps, names, readable, where)
    found += blended_finding([fact.small for fact in facts], steps, readable, where)
    found += return_finding([fact.small for fact in facts], steps, names, readable, where)
    found += exchanged_findings([fact.small for fact in facts], steps, names, readable, where)
    found += order_findings([fact.small for fact in facts], names, readable, where)
    for i in range(1, len(facts)):
        if readable[i - 1] and readable[i] and not 1 / JUMP < means[i] / means[i - 1] < JUMP:
            what = f"brightness changes by {means[i] / means[i - 1]:.2f} times (limit {JUMP})"
            found.append(finding("exposure-jump", where, what, i))
    found += colour_findings([fact.small for fact in facts], readable, where)
    found += _of_clip(facts, means, where)
    grey = [fact.small.mean(axis=2) for fact in facts]
    sharp = np.array([fact.fine for fact in facts]).reshape(-1, 2)
    found += blurred_findings(sharp, grey, names, readable, where)
    found += cut_findings(grey, names, readable, where) + halves_finding(grey, where)
    found += alternating_finding(grey, where) or light_findings([fact.small for fact in facts], readable, where)
    found += _blue_finding(facts, where)
    found += _woven_finding([fact.comb for fact in facts], "rows", WOVEN, where)
    found += _woven_finding([fact.comb_across for fact in facts], "columns", ACROSS, where)
    if facts and all((fact.small == fact.small[:, :, :1]).all() for fact in facts):
        found.append(finding("grey-pictures", where, "every picture is grey"))
    return found


def _woven_finding(combs: list[float], lines: str, least: float, where: str) -> list[Finding]:
    """A warning on pictures that combine two; lines: their rows, or their columns; least: of a comb."""
    woven = [comb for comb in combs if comb > least]  # of film as video, two of five pictures
    if not woven or len(woven) < PART * len(combs):
        return []
    some = "" if 2 * len(woven) > len(combs) else f" in {len(woven)} of {len(combs)} frames"
    what = f"neighbouring {lines} differ {np.median(woven):.2f} times as much as {lines} two apart{some}"
    return [finding("interlaced-pictures", where, what)]


def _of_clip(facts: list[FrameFacts], means: NDArray[np.floating], where: str) -> list[Finding]:
    """A clip without content, or with one constant picture."""
    flat = [float(np.ptp(fact.small, axis=(0, 1)).max()) <= FLAT for fact in facts]
    empty = [k for k, mean in enumerate(means) if flat[k] or not BLACK <= mean <= WHITE]
    if len(empty) > NOTHING * len(facts):
        named = shortened([facts[k].name for k in empty])
        what = f"{len(empty)} of {len(facts)} frames are black, white or of one colour: {named}"
        return [finding("no-picture", where, what, empty[0])]
    names, frames = [fact.name for fact in facts], [fact.small for fact in facts]
    if len({frame.shape for frame in frames}) != 1 or len(frames) < 2:
        return []
    repeated = all(np.abs(b - a).mean() < SAME for a, b in pairwise(frames))
    if repeated and all(np.abs(frame - frames[0]).mean() < FROZEN for frame in frames):
        return [finding("constant-clip", where, f"all {len(facts)} frames are one picture: {shortened(names)}", 0)]
    return []


def _blue_finding(facts: list[FrameFacts], where: str) -> list[Finding]:
    """A warning on a clip whose pictures are more blue than red: red and blue exchanged, or a negative.

    Tissue has far more red than green, and hardly more green than blue. The far step is from blue to green once red and
    blue are exchanged, and from green to red in a negative.
    """
    means = np.array([fact.small.mean(axis=(0, 1)) for fact in facts] or [np.zeros(3)])
    red, green, blue = np.median(means, axis=0).tolist()
    if blue - red < BLUE:
        return []
    above = "grey levels above red on average"
    if green - red > blue - green:
        return [finding("negative-pictures", where, f"blue is {blue - red:.0f} and green {green - red:.0f} {above}")]
    return [finding("blue-pictures", where, f"blue is {blue - red:.0f} {above}")]


def _of_frame(fact: FrameFacts, mean: float, where: str, i: int) -> list[Finding]:
    """A frame without content, or overexposed in large parts."""
    if mean < BLACK:
        return [finding("black-frame", where, f"{fact.name} is black (mean {mean:.1f} of 255)", i)]
    if mean > WHITE:
        return [finding("white-frame", where, f"{fact.name} is white (mean {mean:.1f} of 255)", i)]
    if fact.clipped > CLIPPED:
        return [finding("clipped-frame", where, f"{fact.name}: {fact.clipped:.0%} of it is fully white", i)]
    return []


def time_findings(times: NDArray[np.float64] | None, where: str) -> list[Finding]:
    """A note on stated, uneven frame times."""
    if times is None or len(times) < 2 or evenly_spaced(times):
        return []
    steps = np.diff(times)
    return [finding("uneven-times", where, f"the frames are {steps.min():.3g} to {steps.max():.3g} s apart")]


def rate_findings(times: NDArray[np.float64] | None, rate: float | None, where: str) -> list[Finding]:
    """A warning on a frame rate that no camera has; `times` (n,) in seconds come before the stated `rate`."""
    if times is not None and len(times) > 1:
        rate = usual_rate(times)
    if rate is None or SLOWEST <= rate <= FASTEST:
        return []
    return [finding("frame-rate", where, f"{rate:.3g} frames a second, {1 / rate:.3g} s between two")]


def profile_findings(files: list[Path]) -> list[Finding]:
    """A note on pictures with a colour profile, a gamma or primaries other than those of sRGB."""
    found = [file for file in files if colours_differ(file)]
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return [finding("colour-profile", file, f"states a colour profile other than sRGB{more}") for file in found[:1]]


def gap_findings(files: list[Path]) -> list[Finding]:
    """Missing frame numbers, for example of deleted or undecodable frames, and names in another order than time."""
    return _number_gaps(files) + clock_findings(files)


def _number_gaps(files: list[Path]) -> list[Finding]:
    numbers = frame_numbers(files)
    if numbers is None or len(files) < 3 or len(numbers[0]) != 1:
        return []
    steps = np.diff([number[0] for number in numbers])
    usual = int(np.median(steps))
    wide = np.flatnonzero(steps != usual)
    if not wide.size:
        return []
    i = int(wide[0])
    what = f"{counted(wide.size, 'gap')} in the numbers; the first is between {files[i].name} and {files[i + 1].name}"
    return [finding("number-gap", files[0].parent, what, i + 1)]
