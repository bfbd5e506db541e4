"""Rates of periodic motion: spectral lines of the leading modes of the flow.

A mode is a time course shared by many tiles (singular value decomposition). A line is a rate f of at least three cycles
per clip whose sine and cosine at f, or at f and 2 f, or at f, 2 f and 3 f explain the residual of slow motion: F test
at `ALARM` over all rates, at least `EXPLAINED` of the variance, and similar amplitude and phase of the wave at f in the
three thirds of the clip (`COHERENT`). The last condition rejects a single event, such as a pull.
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

from endotsr.clips.effects.frames import residual, slow_courses
from endotsr.method.kernels.arrays import FloatArray

LEAST_CYCLES = 3.0
SLOW = 4  # slow motion: 0, 1, 2 or 3 half waves over the clip
MODES = 4
LEAST_VARIANCE = 0.01  # fraction of a mode left by slow motion; a smaller residual is rounding
STEP = 0.1  # between tested rates, cycles per sequence
ALARM = 0.01  # probability of a line in noise, over all rates
EXPLAINED = 0.6  # of the variance that slow motion leaves
COHERENT = 0.3  # largest distance of a third's wave from the mean of the three, relative to that mean
LINES_OF_A_MODE = 2
LEAST_AMPLITUDE = 1.0  # RMS of the line in its second strongest tile, relative to the noise flow there
SAME = 0.5  # cycles per sequence: a line closer to a multiple of a lower line is discarded


class Line(NamedTuple):
    """A motion rate."""

    cycles: float  # per sequence
    harmonics: int  # multiples of the rate that are present, including the rate itself
    explained: float  # fraction of the variance of its mode without slow motion
    probability: float  # of such a line in noise (F test over all rates)
    size: float  # RMS of the line over that of its mode


def spectral_lines(tiles: FloatArray, times: FloatArray, frames: int, null: FloatArray) -> list[Line]:
    """Lines of the tile flow (m, 2, U), the least probable in noise first.

    null     (U,) the noise flow, which weights the tiles
    frames   of the whole sequence: the highest tested rate is frames / 2.2
    """
    m = len(times)
    flat = (tiles / np.maximum(null, 0.05)).reshape(m, -1)
    flat = flat - flat.mean(axis=0)
    courses, sizes, places = np.linalg.svd(flat, full_matrices=False)
    found: list[Line] = []
    for k in range(min(MODES, len(sizes))):
        tile = np.sort(np.hypot(*places[k].reshape(2, -1)))[-2:][0] * sizes[k] / m**0.5
        found += [line for line in _lines_of(courses[:, k], times, frames) if line.size * tile >= LEAST_AMPLITUDE]
    merged: list[Line] = []
    for line in sorted(found, key=lambda line: line.cycles):
        multiples = [line.cycles / other.cycles for other in merged]
        if all(abs(ratio - round(ratio)) * other.cycles > SAME for ratio, other in zip(multiples, merged)):
            merged.append(line)
    return sorted(merged, key=lambda line: line.probability)


def _lines_of(course: FloatArray, times: FloatArray, frames: int) -> list[Line]:
    """Lines of one mode, found one at a time. Each is removed before the next is sought."""
    base, lines = slow_courses(times, SLOW), []
    for _ in range(LINES_OF_A_MODE):
        line = _strongest(course, times, frames, base)
        if line is None:
            break
        lines.append(line)
        base = np.concatenate([base, _waves(times, line.cycles, line.harmonics)], axis=1)
    return lines


def _strongest(course: FloatArray, times: FloatArray, frames: int, base: FloatArray) -> Line | None:
    """The rate whose wave is the least probable in noise, if it passes all conditions."""
    left, m = residual(base, course), len(times)
    total = float(left @ left)
    highest = frames / 2.2
    rates = np.arange(LEAST_CYCLES, highest, STEP)
    if total <= LEAST_VARIANCE * float(course @ course) or not rates.size or m - base.shape[1] < 10:
        return None
    best: tuple[float, float, int] | None = None
    for rate in rates:
        for harmonics in (1, 2, 3):
            if harmonics * rate > highest:
                break
            rest = residual(np.concatenate([base, _waves(times, rate, harmonics)], axis=1), course)
            free, used = m - base.shape[1] - 2 * harmonics, 2 * harmonics
            square = max(float(rest @ rest), 1e-12 * total)
            single = stats.f.sf((total - square) / used / (square / free), used, free)
            if best is None or single < best[0]:
                best = (float(single), float(rate), harmonics)
    assert best is not None
    single, rate, harmonics = best
    probability = min(1.0, single * 3 * highest)  # about one independent rate per cycle, three harmonic counts
    rest = residual(np.concatenate([base, _waves(times, rate, harmonics)], axis=1), course)
    explained = 1.0 - float(rest @ rest) / total
    if probability > ALARM or explained < EXPLAINED or not _coherent(left, times, rate):
        return None
    return Line(rate, harmonics, explained, probability, (explained * total / float(course @ course)) ** 0.5)


def _waves(times: FloatArray, rate: float, harmonics: int) -> FloatArray:
    phase = 2 * np.pi * rate * times[:, None] * np.arange(1, harmonics + 1)
    return np.concatenate([np.sin(phase), np.cos(phase)], axis=1)


def _coherent(left: FloatArray, times: FloatArray, rate: float) -> bool:
    """Whether the wave has similar amplitude and phase in each third of the clip."""
    waves = []
    for part in np.array_split(np.arange(len(times)), 3):
        if len(part) < 5:
            return False
        design = np.concatenate([np.ones((len(part), 1)), _waves(times[part], rate, 1)], axis=1)
        _, sine, cosine = np.linalg.lstsq(design, left[part], rcond=None)[0]
        waves.append(complex(cosine, sine))
    mean = sum(waves) / 3
    return max(abs(wave - mean) for wave in waves) <= COHERENT * abs(mean)
