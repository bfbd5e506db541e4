"""Photometric change: common gain, white balance, and local change of light.

The frames are first warped onto the reference frame along their flow. g is the log ratio of the mean colours of a tile
in two frames, without saturated and dark pixels. The gain of a frame is the median over the tiles. An F test compares
its variance between frames with that of the median under pixel noise. The residual of a tile is local change if smooth
courses over time explain it (F test with Bonferroni correction over the tiles) and its size is visible. With fewer than
four tiles that most frames show, nothing can be compared: the verdict is then "unknown", and a change is assumed.
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

from endotsr.clips.effects.frames import (
    LUMINANCE,
    TILE,
    ReducedFrames,
    residual,
    slow_courses,
    tile_map,
    tile_means,
    without_gaps,
)
from endotsr.clips.effects.noise import Noise
from endotsr.clips.effects.tracks import FlowTracks
from endotsr.clips.effects.verdict import UNKNOWN, Curve, EffectVerdict, Map, sentence
from endotsr.method.kernels.arrays import BoolArray, FloatArray, IndexArray

DARK, BRIGHT = 0.05, 0.95  # display units: pixels outside this range are not compared
ALARM = 0.01
LEAST_CHANGE = 1.0 / 255.0  # display units: a smaller change cannot be displayed
COURSES = 8  # smooth courses over time, half waves 1 ... 8
LOCAL_FRACTION = 0.02  # minimum fraction of changed tiles for local change
LEAST_LOCAL = 1.0 / 255.0  # RMS in a tile, display units
GRADIENT_ERROR = 0.25  # px: alignment error under motion, which appears as a change of light at edges
LEAST_TILES = 4


class Ratios(NamedTuple):
    """Log ratios of tile colours to the reference frame."""

    values: FloatArray  # (m, 3, U) of the usable tiles, without their mean over time
    noise: FloatArray  # (3, U) standard deviation due to pixel noise
    level: FloatArray  # (U,) luminance of the tile, display units
    tiles: IndexArray  # (U,) number of each tile in the grid


def photometric_verdict(clip: ReducedFrames, tracks: FlowTracks, noise: Noise, moving: bool) -> EffectVerdict:
    """The verdict on changes of light."""
    ratios = colour_ratios(clip, tracks, noise)
    if ratios.values.shape[2] < LEAST_TILES:
        return _unknown("Fewer than four tiles of tissue are visible in most frames; a change of light is assumed.")
    gain = np.median(ratios.values, axis=2)
    level = float(np.median(ratios.level))
    error = error_of_median(ratios)
    common = gain @ LUMINANCE
    balance = gain - common[:, None]
    ranges = {"gain": _range(common) * level, "white balance": max(_range(b) for b in balance.T) * level}
    f = {
        "gain": float(common.var(ddof=1) / (error @ LUMINANCE) ** 2),
        "white balance": float((balance.var(axis=0, ddof=1) / error**2).max()),
    }
    critical = float(stats.f.isf(ALARM / 3, len(gain) - 1, max(2, ratios.values.shape[2] - 1)))
    local, sizes = local_change(clip, ratios, gain, moving)
    found = [name for name in f if f[name] > critical and ranges[name] >= LEAST_CHANGE]
    fraction = float(local.mean())
    if fraction >= LOCAL_FRACTION:
        found.append("local")
    score = {name: min(f[name] / critical, ranges[name] / LEAST_CHANGE) for name in f}
    statistic = max(*score.values(), fraction / LOCAL_FRACTION)
    return _verdict(clip, found, statistic, ranges, fraction, common, balance, ratios, sizes)


def colour_ratios(clip: ReducedFrames, tracks: FlowTracks, noise: Noise) -> Ratios:
    """Log ratios of the mean colours of the tiles that most frames see; gaps are interpolated in time."""
    reference = clip.reference
    start = clip.images[reference]
    rows = []
    usable = tracks.usable.copy()
    pixels = np.full(usable.size, np.inf)
    for k in range(clip.count):
        moved = tracks.aligned[k]
        both = tracks.valid[k] & _comparable(start) & _comparable(moved)
        now, count = tile_means(moved, both)
        then, _ = tile_means(start, both)
        with np.errstate(all="ignore"):
            rows.append(np.log(now / then))
        pixels = np.minimum(pixels, np.where(count > 0, count, np.inf))
    values = np.array(rows)
    usable &= np.isfinite(values).mean(axis=0).min(axis=0) >= 0.6
    values = without_gaps(values[:, :, usable], clip.times)
    level = tile_means(start, clip.masks[reference])[0][:, usable]
    level = np.where(np.isfinite(level), level, 0.5)
    count = np.clip(pixels[usable], TILE, TILE * TILE)
    deviation = noise.working[:, None] / (np.maximum(level, DARK) * np.sqrt(count))
    centred = values - values.mean(axis=0)
    return Ratios(centred, deviation, LUMINANCE @ level, np.flatnonzero(usable))


def local_change(clip: ReducedFrames, ratios: Ratios, gain: FloatArray, moving: bool) -> tuple[BoolArray, FloatArray]:
    """(U,) tiles whose light changes smoothly beyond the gain of the frame, and the RMS of the change, display units.

    With motion, the threshold allows for an alignment error of a quarter pixel at the gradients of the tile.
    """
    left = np.einsum("mcu,c->mu", ratios.values - gain[:, :, None], LUMINANCE)
    left = left - left.mean(axis=0)
    m = len(left)
    courses = min(COURSES, (m - 2) // 2)
    if courses < 1:
        return np.zeros(left.shape[1], bool), np.zeros(left.shape[1])
    rest = residual(slow_courses(clip.times, courses + 1), left)
    free = m - courses - 1
    floor = (LUMINANCE @ ratios.noise) ** 2 * free
    explained = (left**2).sum(axis=0) - (rest**2).sum(axis=0)
    ratio = explained / courses / (np.maximum((rest**2).sum(axis=0), floor) / free)
    critical = stats.f.isf(ALARM / 3 / left.shape[1], courses, free)
    size = np.sqrt(np.maximum(explained, 0.0) / m) * ratios.level
    needed = LEAST_LOCAL + (GRADIENT_ERROR * _tile_gradient(clip)[ratios.tiles] if moving else 0.0)
    return (ratio > critical) & (size > needed), size


def _tile_gradient(clip: ReducedFrames) -> FloatArray:
    """Mean absolute gradient of each tile over the square root of its rows: the effect of a common shift."""
    grey = clip.luminance[clip.reference]
    down, across = np.gradient(grey)
    return np.nan_to_num(tile_means(np.hypot(down, across), clip.masks[clip.reference])[0]) / TILE**0.5


def _comparable(image: FloatArray) -> BoolArray:
    return (image.max(axis=0) < BRIGHT) & (image.max(axis=0) > DARK) & (image.min(axis=0) > 0.0)


def error_of_median(ratios: Ratios) -> FloatArray:
    """Standard error (3,) of the median over tiles under noise alone."""
    return 1.2533 * np.sqrt((ratios.noise**2).mean(axis=1) / ratios.values.shape[2])


def _range(course: FloatArray) -> float:
    """From the 5th to the 95th percentile."""
    low, high = np.percentile(course, (5, 95))
    return float(high - low)


def _unknown(reason: str) -> EffectVerdict:
    return EffectVerdict("photometric", True, UNKNOWN, 1.0, 1.0, "times the threshold",
                         "variance of the gain of the frames", ALARM, reason)  # fmt: skip


def _verdict(
    clip: ReducedFrames, found: list[str], statistic: float, ranges: dict[str, float], fraction: float,
    common: FloatArray, balance: FloatArray, ratios: Ratios, sizes: FloatArray,
) -> EffectVerdict:  # fmt: skip
    words = {
        "gain": f"the gain of the frames ranges over {255 * ranges['gain']:.1f} grey levels",
        "white balance": f"the channels drift apart by {255 * ranges['white balance']:.1f} grey levels",
        "local": f"the light changes by itself in {fraction:.0%} of the tissue",
    }
    reason = sentence(words, found, "No gain, white balance or local light changes visibly.")
    picture = np.full((clip.images.shape[2] // TILE) * (clip.images.shape[3] // TILE), np.nan)
    picture[ratios.tiles] = 255 * sizes
    lines = {"gain": 100 * common, "red": 100 * balance[:, 0], "blue": 100 * balance[:, 2]}
    return EffectVerdict(
        "photometric", bool(found), " + ".join(found) or "none", statistic, 1.0, "times the threshold",
        "F ratio of the variance of the frame gain over noise, its range over one grey level, changed tiles over 2 %",
        ALARM, reason, {"range": ranges, "local_fraction": fraction},
        Curve("gain, and red and blue against it, percent", "time", clip.times, lines),
        Map("local change of light, RMS, grey levels", tile_map(picture, *clip.images.shape[2:])),
    )  # fmt: skip
