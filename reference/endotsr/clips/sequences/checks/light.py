"""Light that changes from frame to frame: two kinds of light in turn, and brightness that flickers.

In: small pictures of the frames. Out: findings. Motion takes a picture farther from the one before the last than from
the last, and two kinds of light in turn do the opposite. The brightness of a scene changes slowly; a shutter that is
out of step with the light, or an exposure that hunts, changes it with a period of a few frames.
"""

from itertools import pairwise

import numpy as np

from endotsr.clips.sequences.checks.exchanged import steps_across
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray, FloatArray

FEWEST = 6  # frames
# Median step between neighbours of that between frames two apart, at equal brightness: at most 1.03 on 12 clips, also
# every second or third frame and parts of the pictures, and there where nothing moves. Narrow-band light in turn with
# white light has 2.6 or more on them, and light of one colour 5 or more.
IN_TURN = 1.3
LONG, SMOOTHED = 32, 7  # frames of a clip whose brightness is looked at; of the mean that is taken from it
SLOWEST = 6.0  # frames of a period
# Part of the fast change of the brightness that one period has, and its amplitude as a part of the brightness. An
# instrument in a quarter of the picture has up to 0.92 and 0.029 in 16 to 24 frames of these clips, exposures that jump
# 0.66 and 0.047; the whole pictures of recorded clips have up to 0.007.
REGULAR, STRONG = 0.75, 0.03


def light_findings(small: list[np.ndarray], readable: BoolArray, where: str) -> list[Finding]:
    """Warnings on two kinds of light in turn, and on flicker.

    small      pictures (h, w, 3) of the frames
    readable   frames that are neither black nor white
    """
    if len(small) < FEWEST or not readable.all() or len({picture.shape for picture in small}) != 1:
        return []
    means = np.array([float(picture.mean()) for picture in small])
    return _in_turn(small, means, where) or _flicker(means, where)


def _in_turn(small: list[np.ndarray], means: FloatArray, where: str) -> list[Finding]:
    equal = [picture * np.float32(means.mean() / mean) for picture, mean in zip(small, means)]
    near = float(np.median([np.abs(b - a).mean() for a, b in pairwise(equal)]))
    across = float(np.median(steps_across(equal)))
    if near <= IN_TURN * across:
        return []
    what = (
        f"every picture differs from the next by {near:.1f} grey levels and from the next but one by {across:.1f}"
        f" (medians at equal brightness; the limit is {IN_TURN} times)"
    )
    return [finding("alternating-views", where, what)]


def _flicker(means: FloatArray, where: str) -> list[Finding]:
    """A warning on brightness that goes up and down with a period of 2 to 6 frames."""
    if len(means) < LONG:
        return []
    part, amplitude, period = flicker_of(means)
    if part < REGULAR or amplitude < STRONG:
        return []
    what = (
        f"the brightness changes by {amplitude:.1%} up and down with a period of {period:.1f} frames, which is"
        f" {part:.0%} of its fast change (limits {STRONG:.0%} and {REGULAR:.0%})"
    )
    return [finding("flicker", where, what)]


def flicker_of(means: FloatArray) -> tuple[float, float, float]:
    """Of the strongest period: its part of the fast change, its amplitude relative to the brightness, its frames.

    means   (n,) brightness of the frames
    """
    log = np.log(np.maximum(means, 1.0))
    half = SMOOTHED // 2
    smooth = np.convolve(np.pad(log, half, mode="reflect"), np.full(SMOOTHED, 1 / SMOOTHED), "valid")
    window = np.hanning(len(log) + 2)[1:-1]
    power = np.abs(np.fft.rfft((log - smooth) * window)) ** 2
    frequency = np.fft.rfftfreq(len(log))
    fast = np.where(frequency >= 1 / SLOWEST, power, 0.0)
    k = int(fast.argmax())
    part = power[max(0, k - 1) : k + 2].sum() / max(power.sum(), 1e-12)
    sides = 1 if 2 * k == len(log) else 2  # the shortest period has one term of the two of others
    return float(part), float(sides * np.sqrt(fast[k]) / window.sum()), float(1 / max(frequency[k], 1e-9))
