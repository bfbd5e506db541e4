"""The clock of a recording: seconds of its pictures from their time stamps, and the places where it jumps.

In: one stamp per picture, in the order in which they are shown. Out: `Clock`. Joined files start their clock again, a
recorder that pauses leaves a gap, and a transport stream counts to 2^33 and then from 0.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

REORDERED = 0.1  # fraction of steps that go back, above which the stamps are in the order of decoding
JUMP = 10.0  # usual steps between two pictures that count as a jump, if it is LEAST seconds or more
LEAST = 1.0


class Clock(NamedTuple):
    """Times of the pictures."""

    times: NDArray[np.float64] | None  # (n,) seconds from the first picture, ascending; None: unknown
    rate: float | None  # pictures per second; None: unknown
    remark: str = ""  # on a jump, in words
    stands: bool = True  # False: one jump is longer than all other steps together


def clock_of(stamps: NDArray[np.float64], stated: float | None) -> Clock:
    """The clock of stamps in seconds.

    stamps   (n,) in the order in which the pictures are shown; NaN: not stated
    stated   pictures per second that the file states on average, or None
    """
    if len(stamps) < 2 or not np.isfinite(stamps).all():
        return Clock(None, stated)
    steps = np.diff(stamps)
    if not (steps > 0).any():
        return Clock(None, stated)
    if (steps < 0).mean() > REORDERED:  # AVI states no times; pictures that refer to later ones are stored after them
        rate = 1 / float(np.median(np.diff(np.unique(stamps))))
        return Clock(None, rate, f"states no times of display: frames count as evenly spaced, {rate:g} a second")
    usual = float(np.median(steps[steps > 0]))
    if (steps <= 0).any():
        at = int(np.flatnonzero(steps <= 0)[0])
        back = f"its clock goes back by {-steps[at]:.3g} s after picture {at}: frames count as evenly spaced, as with"
        return Clock(None, 1 / usual, f"{back} --source-rate {1 / usual:g}" if steps[at] < 0 else "")
    rate = (len(stamps) - 1) / float(stamps[-1] - stamps[0])
    jumps = np.flatnonzero((steps > JUMP * usual) & (steps >= LEAST))
    if not jumps.size:
        return Clock(stamps - stamps[0], rate)
    at = int(jumps[0])
    more = f" ({jumps.size - 1} more jumps)" if jumps.size > 1 else ""
    remark = f"its clock jumps by {steps[at]:.3g} s after picture {at}{more}; others are {usual:.3g} s apart"
    return Clock(stamps - stamps[0], rate, remark, bool(2 * steps[jumps].max() < steps.sum()))
