"""Depth whose numbers did not fit the type of their file and begin again at 0, as tenths of millimetres in 8 bits do.

In: the integers of a depth file. Out: the part of the pixels that lie beside a step from the largest numbers of the
type to the smallest ones. A step to the least number of a frame does not count: normalised depth is clipped to it, and
has it in an instrument that is near. The median over the frames:

    EndoNeRF depth, also normalised, clipped and as disparity, C3VD, simulated depth     0.00000
    the same, smooth, in tenths of millimetres, in 8 bits                                0.0002 to 0.0007
    the same in twentieths                                                               0.002 to 0.005
    the same in micrometres in 16 bits, where it exceeds 65 mm                           0.002 to 0.004

Gentle slopes across few multiples of 256 have fewer such steps: 0, which marks missing depth, lies between its ends.
"""

import numpy as np
from numpy.typing import NDArray

WRAPPED = 0.0002  # of the pixels; single frames of sound depth have at most 0.00004
BESIDE_ENDS = 32  # a step is one of the whole range but for one of so many parts


def wrapped_part(stored: NDArray) -> float:
    """The number of steps between the two ends of the type, relative to that of the pixels; 0 for other than integers.

    stored   (H, W) the numbers of a file, 0 = missing; those up to 255 count as of 8 bits
    """
    if stored.dtype.kind not in "iu" or not stored.any():
        return 0.0
    values = stored.astype(np.int64)
    lowest = int(values[values > 0].min(initial=1 << 16))
    span = 1 << 8 if values.max() < 1 << 8 else 1 << 16
    steps = 0
    for one, other in ((values[1:], values[:-1]), (values[:, 1:], values[:, :-1])):
        low, high = np.minimum(one, other), np.maximum(one, other)
        steps += np.count_nonzero((low > lowest) & (high - low >= span - span // BESIDE_ENDS))
    return steps / stored.size
