"""Depth that was resized with interpolation across pixels without depth.

In: the depth of a frame. Out: how many pixels beside a hole are far nearer than those around them. A hole is stored as
0, and a mean of 0 and a depth is a depth that no tissue has.
"""

import numpy as np

from endotsr.method.kernels.arrays import FloatArray

AROUND = 7  # pixels of a square in which the farthest depth is that of the tissue
NEARER = 0.7  # of this depth
FEWEST = 50  # pixels beside holes


def blended_rim(depth: FloatArray) -> float:
    """The fraction of the pixels beside a hole of a depth (H, W), 0 = none, that are far nearer; NaN for few.

    At most 0.01 on four recorded and twelve simulated clips, 1.00 on each of them after a resizing by two with linear
    interpolation.
    """
    from scipy.ndimage import binary_dilation, maximum_filter

    known = depth > 0
    rim = known & np.asarray(binary_dilation(~known, np.ones((3, 3), bool)), bool)
    if np.count_nonzero(rim) < FEWEST:
        return float("nan")
    farthest = maximum_filter(np.where(known, depth, 0), AROUND)
    return float((depth[rim] < NEARER * farthest[rim]).mean())
