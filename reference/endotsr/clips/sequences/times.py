"""Times of frames: normalised, even or uneven, and the frame rate that they give.

In: the times of frames, seconds, or their count. Out: normalised times, and the rate.
"""

import numpy as np
from numpy.typing import NDArray

UNEVEN, ROUNDING = 0.1, 1.1e-3  # tolerance of even spacing: of the mean step; rounding of containers, seconds


def time_stamps(count: int) -> NDArray[np.float64]:
    """t_i = i / n for i = 0 .. n-1 (ruling: 1 is never reached). Shape (n,)."""
    return np.arange(count) / count


def normalised_times(times: NDArray[np.float64] | None, count: int) -> NDArray[np.float64]:
    """Normalised times of possibly uneven frames: t_i = (s_i - s_0) / (s_{n-1} - s_0) (n - 1) / n.

    times    (n,) strictly ascending, in any unit; None: evenly spaced
    returns  (n,) from 0 to (n - 1) / n

    Edges:   evenly spaced times give i / n to rounding; None gives it exactly (`time_stamps`).
    """
    if times is None or count < 2:
        return time_stamps(count)
    return (times - times[0]) / (times[-1] - times[0]) * ((count - 1) / count)


def evenly_spaced(times: NDArray[np.float64]) -> bool:
    """Whether all frames are within a tenth of a step, or the rounding of containers, of an even grid."""
    if len(times) < 3:
        return True
    step = (times[-1] - times[0]) / (len(times) - 1)
    off = np.abs(times - times[0] - step * np.arange(len(times))).max()
    return bool(off <= max(UNEVEN * step, ROUNDING))


def usual_rate(times: NDArray[np.float64]) -> float | None:
    """Frames per second, by the median step of ascending times (n,); None for one time, or a median step of 0."""
    steps = np.diff(times)
    usual = float(np.median(steps)) if steps.size else 0.0
    return 1 / usual if usual > 0 else None
