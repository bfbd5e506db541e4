"""Single frames that are out of focus or blurred by motion, among sharp neighbours.

In: the fine detail of the frames. Out: findings. It is the mean difference between a row and its two neighbours,
relative to the brightness, and the same of columns: motion along the rows blurs the columns alone.
"""

import numpy as np

from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.checks.scenes import correlation
from endotsr.method.kernels.arrays import BoolArray, FloatArray

# Fine detail of a frame of that of its neighbours, the better of two on either side: at least 0.80 on 12 clips, also
# every second or third frame and parts of the pictures. A Gaussian blur of one pixel leaves 0.18 to 0.47 on them, and
# motion by five pixels 0.22 to 0.39.
BLURRED = 0.62
BESIDE = 2  # frames on either side
ALIKE = 0.7  # least correlation with both neighbours, reduced: what covers the view has no detail either


def sharpness(near: float, brightness: float) -> float:
    """The difference of neighbouring rows or columns, relative to the brightness; grey levels at least 1."""
    return near / max(brightness, 1.0)


def blurred_findings(
    sharp: FloatArray, grey: list[FloatArray], names: list[str], readable: BoolArray, where: str
) -> list[Finding]:
    """A warning for each frame that is less sharp than those on both sides.

    sharp      (n, 2) fine detail along columns and along rows
    grey       (h, w) of every frame, reduced
    readable   frames that are neither black nor white
    """
    found = []
    for i in range(1, len(sharp) - 1):
        part = slice(max(0, i - BESIDE), i + BESIDE + 1)
        if not readable[part].all():
            continue
        sides = np.minimum(sharp[part.start : i].max(axis=0), sharp[i + 1 : part.stop].max(axis=0))
        left = float((sharp[i] / np.maximum(sides, 1e-9)).min())
        if left < BLURRED and (sides > 0).all() and _alike(grey[i - 1 : i + 2]):
            what = f"{names[i]} has {left:.0%} of the fine detail of the frames on both sides (limit {BLURRED:.0%})"
            found.append(finding("blurred-frame", where, what, i))
    return found


def _alike(grey: list[FloatArray]) -> bool:
    """Whether the middle one of three pictures shows what the others show."""
    same = len({picture.shape for picture in grey}) == 1
    return same and min(correlation(grey[0], grey[1]), correlation(grey[1], grey[2])) >= ALIKE
