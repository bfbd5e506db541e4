"""Colour planes that are displaced against each other: an anaglyph of two views, or colours of different moments.

In: pictures of a clip, one frame at a time. Out: findings. The detail of the red, green and blue planes of one view
lies at one place. In a red and cyan anaglyph red is that of the left view; a camera that takes the colours one after
another displaces them where something moves.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.sampling import even_frames, reduced_to
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray

SAMPLED, FEWEST, WORKING = 12, 3, 320  # frames of a clip, and of a finding; columns of the pictures that are looked at
COARSE, SMALLEST = 3.0, 32  # px, standard deviation of the blur that is taken away; px, rows and columns of a picture
# Displacement in px of the working size, and correlation of the detail there: that, and more than without displacement.
# On 12 clips and on parts of their pictures the detail of all planes fits best without any, with a correlation of 0.69
# or more. Two recorded pairs as anaglyphs have 0.22 and 0.40 at 18 and 9 px, and 0.00 without displacement; a plane
# that is displaced by three pixels has 0.7 or more there, and 0.24 or less without.
DISPLACED, FITS, BETTER = 2.0, 0.15, 0.15
MOST = 0.5  # of the frames


class ColourPlanes:
    """The displacements of the colour planes in some frames of a clip of `count` frames."""

    def __init__(self, count: int) -> None:
        self._sampled = set(even_frames(count, SAMPLED)) if count else set()
        self._found: list[list[tuple[float, float, float, float]]] = []  # of each frame: red, blue against green

    def add(self, i: int, picture: NDArray[np.uint8]) -> None:
        """Frame i: picture (H, W, 3)."""
        if i not in self._sampled:
            return
        planes = reduced_to(picture, WORKING).astype(np.float64)
        if min(planes.shape[:2]) >= SMALLEST and (planes != planes[:, :, :1]).any():
            self._found.append([displacement(planes[:, :, k], planes[:, :, 1]) for k in (0, 2)])

    def findings(self, where: str) -> list[Finding]:
        """A warning if the red or the blue plane is displaced in most of the frames."""
        if len(self._found) < FEWEST:
            return []
        for k, name in enumerate(("red", "blue")):
            values = [frame[k] for frame in self._found]
            displaced = [
                one for one in values if np.hypot(*one[:2]) >= DISPLACED and one[2] >= max(FITS, one[3] + BETTER)
            ]
            if len(displaced) > MOST * len(values):
                x, y, fit, still = np.median(displaced, axis=0)
                what = (
                    f"in {len(displaced)} of {len(values)} frames that were compared, the {name} plane lies beside the"
                    f" green one by ({x:.1f}, {y:.1f}) px of {WORKING} columns (limit {DISPLACED:g}): correlation of"
                    f" the detail {fit:.2f} there, and {still:.2f} without"
                )
                return [finding("shifted-colours", where, what)]
        return []


def displacement(plane: FloatArray, other: FloatArray) -> tuple[float, float, float, float]:
    """Columns and rows by which a plane (h, w) lies beside the other, the correlation of the detail there and at 0."""
    height, width = plane.shape
    window = np.outer(np.hanning(height), np.hanning(width))
    one, two = (window * (values - gaussian_filter(values, COARSE)) for values in (plane, other))
    size = float(np.sqrt((one**2).sum() * (two**2).sum()))
    if size == 0:
        return 0.0, 0.0, 0.0, 0.0
    fits = np.fft.irfft2(np.fft.rfft2(one) * np.conj(np.fft.rfft2(two)), s=plane.shape) / size
    row, column = np.unravel_index(int(fits.argmax()), fits.shape)
    x, y = ((int(k) + n // 2) % n - n // 2 for k, n in ((column, width), (row, height)))
    return float(x), float(y), float(fits.max()), float(fits[0, 0])


def loaded_plane_findings(sequence: Sequence, where: str) -> list[Finding]:
    """`ColourPlanes.findings` of a sequence in memory."""
    planes = ColourPlanes(sequence.count)
    for i in even_frames(sequence.count, SAMPLED):
        planes.add(i, sequence.picture(i))
    return planes.findings(where)
