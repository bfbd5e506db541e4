"""Checks that the pictures show one view of one scene.

In: small grey pictures of the frames. Out: findings. Two joined takes, or two cameras in turn, train without an error
and give a meaningless scene.
"""

import numpy as np

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.method.kernels.arrays import BoolArray, FloatArray

OTHER_SCENE, SAME_SCENE = 0.4, 0.7  # correlation of neighbouring frames: at a cut, and usually elsewhere
# A step that other steps of the clip come near is its motion: the median distance from the usual correlation, times
# this. In small parts of the EndoNeRF clips, an instrument that passes by has up to 3.8; cuts to another of the clips
# have 4.4 or more there, and 6.5 or more where the usual correlation is above 0.8.
OFTEN = 4.1
ALTERNATING = 0.2  # correlation of pictures two apart minus that of neighbours; motion makes it negative
# Correlation below the usual one at which a zoom is tried; its factors; gain of the best one, and what it may be below
# the usual correlation. On the two EndoNeRF clips no factor gains anything at any step. Where a digital zoom of 1.1 to
# 2 begins between two frames, the best one gains 0.07 to 0.74 and is at most 0.02 below the usual correlation.
UNLIKE, ZOOMS, GAINED, BELOW = 0.04, np.geomspace(1.08, 2.5, 40), 0.05, 0.05


def cut_findings(grey: list[FloatArray], names: list[str], readable: BoolArray, where: str) -> list[Finding]:
    """Frames at which another scene begins, or the same one at another zoom, in a clip of otherwise similar neighbours.

    grey       (h, w) of every frame, reduced
    readable   frames that are neither black nor white
    """
    pairs = [i for i in range(1, len(grey)) if readable[i - 1] and readable[i] and grey[i].shape == grey[i - 1].shape]
    alike = {i: correlation(grey[i - 1], grey[i]) for i in pairs}
    usual = float(np.median(list(alike.values()) or [0.0]))
    if usual < SAME_SCENE:
        return []
    found, least = [], usual - OFTEN * float(np.median([abs(value - usual) for value in alike.values()]))
    for i, value in alike.items():
        if value < usual - UNLIKE and (zoom := _zoom(grey[i - 1], grey[i], usual - BELOW)):
            way = "larger" if zoom > 1 else "smaller"
            what = f"{names[i]} shows {names[i - 1]} {max(zoom, 1 / zoom):.2f} times {way}"
            found.append(finding("zoom-jump", where, what, i))
        elif value < min(OTHER_SCENE, least):
            what = f"{names[i]} does not resemble {names[i - 1]} (correlation {value:.2f}, usually {usual:.2f})"
            found.append(finding("another-scene", where, what, i))
    return found


def _zoom(one: FloatArray, other: FloatArray, least: float) -> float | None:
    """The factor about the centre that turns a picture into the other one; None without one that explains the step.

    least   correlation of the pictures once one of them is zoomed
    """
    from scipy.ndimage import uniform_filter

    one, other = (uniform_filter(picture, 3, mode="nearest") for picture in (one, other))
    fits = [(correlation(_zoomed(one, zoom), other), zoom) for zoom in ZOOMS]
    fits += [(correlation(one, _zoomed(other, zoom)), 1 / zoom) for zoom in ZOOMS]
    fit, zoom = max(fits)
    return float(zoom) if fit >= least and fit - correlation(one, other) >= GAINED else None


def _zoomed(picture: FloatArray, zoom: float) -> FloatArray:
    """The middle part of a picture (h, w), enlarged to its size; nearest pixels."""
    rows, columns = (np.rint((n - 1) / 2 + (np.arange(n) - (n - 1) / 2) / zoom).astype(int) for n in picture.shape)
    return picture[rows][:, columns]


def alternating_finding(grey: list[FloatArray], where: str) -> list[Finding]:
    """Alternating pictures of two cameras, or of two kinds of light.

    grey   (h, w) of every frame, reduced
    """
    if len(grey) < 6 or len({picture.shape for picture in grey}) != 1:
        return []
    one, two = (float(np.median([correlation(a, b) for a, b in zip(grey, grey[k:])])) for k in (1, 2))
    if two < SAME_SCENE or two - one < ALTERNATING:
        return []
    what = f"every picture resembles the next but one (correlation {two:.2f}) more than the next ({one:.2f})"
    return [finding("alternating-views", where, what)]


def correlation(one: FloatArray, other: FloatArray) -> float:
    """The correlation of two pictures of one size; 0 if one is constant."""
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one * one).sum() * (other * other).sum()))
    return float((one * other).sum()) / size if size > 0 else 0.0
