"""Two simultaneous views in each picture, side by side or stacked, as a stereo endoscope writes them.

In: small grey pictures of the frames. Out: findings. The halves of one view resemble each other by their shading alone,
those of two views also by their detail. The detail of a pixel is its surroundings without their mean; the disparity of
the views differs from pixel to pixel:

    fit = mean over the pixels p of max over k of corr(a around p, b around p + (k, 0))

with a, b the halves. The same with the rows of b in another place, moved by a third of them or turned upside down, is
what unrelated detail attains.
"""

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import uniform_filter

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.checks.scenes import correlation
from endotsr.clips.sequences.sampling import even_frames
from endotsr.method.kernels.arrays import FloatArray

ALIKE = 0.6  # correlation of picture halves that two views have; published clips of one view have at most 0.3
# Fit of the detail, and how far it exceeds that with moved rows: 0.67 and 0.37 at least in pairs of two recorded
# clips at five sizes. Halves of parts of twelve clips of one view, with a correlation of 0.6 to 0.81, have a fit up to
# 0.58, or 0.66 and no more than with moved rows.
FITS, EXCEEDS = 0.6, 0.2
SAMPLED, AROUND, NOISE = 4, 9, 4.0  # frames whose detail is compared; pixels of a surrounding; grey levels squared
DARK, LEAST_LIT, MOST_DARK = 20.0, 0.2, 0.4  # grey levels of a black bar; part of a half, and of a surrounding
FARTHEST = 6  # the largest shift between two views is 1 / FARTHEST of the width of a half


def halves_finding(grey: list[FloatArray], where: str) -> list[Finding]:
    """Pictures that seem to contain two simultaneous views.

    grey   (h, w) of every frame, reduced
    """
    large = [picture for picture in grey if min(picture.shape) >= 2 * FARTHEST]
    lit = _lit(large)  # black bars beside a picture make its halves alike
    for layout, halves in (("side by side", _beside), ("stacked", _stacked)):
        alike = float(np.median([_shifted_correlation(*halves(picture), *halves(lit)) for picture in large] or [0.0]))
        if alike <= ALIKE:
            continue
        fits = [_fits(*halves(large[i]), *halves(lit)) for i in even_frames(len(large), SAMPLED)]
        fit, moved = (float(np.median(values)) for values in zip(*fits))
        if fit > FITS and fit - moved > EXCEEDS:
            what = (
                f"the halves of the pictures, {layout}, resemble each other (correlation {alike:.2f}, limit {ALIKE}),"
                f" also in their detail ({fit:.2f}, and {moved:.2f} with rows in other places)"
            )
            return [finding("two-views", where, what)]
    return []


def _lit(pictures: list[FloatArray]) -> FloatArray:
    """(h, w) 1 where some picture is not dark; 1 everywhere for pictures of several sizes."""
    if len({picture.shape for picture in pictures}) != 1:
        return np.ones(pictures[0].shape if pictures else (1, 1))
    return (np.max(pictures, axis=0) > DARK).astype(np.float64)


def _beside(picture: FloatArray) -> tuple[FloatArray, FloatArray]:
    width = picture.shape[1] // 2
    return picture[:, :width], picture[:, -width:]


def _stacked(picture: FloatArray) -> tuple[FloatArray, FloatArray]:
    height = picture.shape[0] // 2
    return picture[:height], picture[-height:]


def _shifted_correlation(one: FloatArray, other: FloatArray, lit: FloatArray, other_lit: FloatArray) -> float:
    """The largest correlation of two pictures over shifts of up to a sixth of the width, where both are lit."""
    if one.shape != lit.shape:
        lit, other_lit = np.ones(one.shape), np.ones(other.shape)
    best = 0.0
    for here, there in _shifts(one.shape[1]):
        both = (lit[:, here] > 0) & (other_lit[:, there] > 0)
        if both.mean() >= LEAST_LIT:
            best = max(best, correlation(one[:, here][both], other[:, there][both]))
    return best


def _shifts(width: int) -> Iterator[tuple[slice, slice]]:
    """The columns of two pictures that lie over one another, for every shift of up to a sixth of the width."""
    most = width // FARTHEST
    for k in range(-most, most + 1):
        yield slice(max(0, k), width + min(0, k)), slice(max(0, -k), width + min(0, -k))


def _fits(one: FloatArray, other: FloatArray, lit: FloatArray, other_lit: FloatArray) -> tuple[float, float]:
    """The fit of the detail of two halves, and the largest fit with the rows of the other one in other places."""
    if one.shape != lit.shape:
        lit, other_lit = np.ones(one.shape), np.ones(other.shape)
    third = len(one) // 3
    moves = (lambda half: np.roll(half, third, 0), lambda half: np.roll(half, -third, 0), lambda half: half[::-1])
    return _fit(one, other, lit, other_lit), max(_fit(one, move(other), lit, move(other_lit)) for move in moves)


def _fit(one: FloatArray, other: FloatArray, lit: FloatArray, other_lit: FloatArray) -> float:
    """The mean over the lit pixels of the largest local correlation along a row; 0 without any."""
    best = np.full(one.shape, -np.inf)
    for here, there in _shifts(one.shape[1]):
        found = _local_correlation(one[:, here], other[:, there], lit[:, here] * other_lit[:, there])
        best[:, here] = np.maximum(best[:, here], found)
    known = best[np.isfinite(best)]
    return float(known.mean()) if known.size else 0.0


def _local_correlation(one: FloatArray, other: FloatArray, lit: FloatArray) -> FloatArray:
    """The correlation (h, w) of what is around each pixel; -inf where too much of it is dark."""
    mean = lambda values: uniform_filter(values * lit, AROUND, mode="constant") / np.maximum(part, 1e-9)
    part = uniform_filter(lit, AROUND, mode="constant")
    about, about_other = mean(one), mean(other)
    spread, spread_other = mean(one**2) - about**2, mean(other**2) - about_other**2
    size = np.sqrt((np.maximum(spread, 0) + NOISE) * (np.maximum(spread_other, 0) + NOISE))
    return np.where(part > 1 - MOST_DARK, (mean(one * other) - about * about_other) / size, -np.inf)
