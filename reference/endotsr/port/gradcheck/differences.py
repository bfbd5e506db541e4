"""Derivatives along a line, from function values only, each with an error bar.

A `line` is a function of one number h: the outputs at x + h v, each entry multiplied by its cotangent. The
differentiated scalar is their sum, but differences are computed entry by entry before summing: small changes are
not lost in large outputs. A line returns None for an h that is rejected.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Line = Callable[[float], NDArray | None]

RATIO = 4.0
LADDER = tuple(1e-2 * RATIO**-k for k in range(9))  # 1e-2 ... 1.5e-7 of the block's size
COARSE = (1e-2 * RATIO**2, 1e-2 * RATIO)  # larger steps, for derivatives that are lost in rounding
SETTLED = 1e-9  # relative agreement of neighbours that ends the refinement


class Difference(NamedTuple):
    """A derivative and its error bound.

    value    the derivative along the line; nan if refused
    error    bound on its error from the agreement of neighbouring steps and from rounding
    step     the finer step of the plateau
    refused  too few steps with a value at both ends
    """

    value: float
    error: float
    step: float
    refused: bool = False


def plateau_difference(line: Line, eps: float = float(np.finfo(np.float64).eps)) -> Difference:
    """Five-point difference at the two neighbouring steps that agree best.

    line   h -> weighted outputs, or None if h must not be used; h in units of the block's size
    eps    rounding unit of the outputs

    The steps decrease by a ratio of 4 until neighbours agree to 1e-9, or to the finest. If the error bar is then above
    1e-6 of the value, or there is none, coarser steps are used too, unless the coarsest of the ladder was refused.

    The error bar is twice the largest of three bounds: the disagreement of the best neighbours, the noise at finer
    steps extrapolated to the chosen one, and the rounding of the outputs.
    """
    slopes = _slopes(line, LADDER, eps)
    best = _best(slopes)
    if slopes and slopes[0].step == LADDER[0] and (best is None or best.error > 1e-6 * abs(best.value)):
        slopes = _slopes(line, COARSE, eps, settle=False) + slopes
        best = _best(slopes)
    if best is None:
        return Difference(np.nan, np.nan, LADDER[-1], refused=True)
    return best


class _Slope(NamedTuple):
    step: float
    central: float
    rounding: float


def _slopes(line: Line, steps: Sequence[float], eps: float, settle: bool = True) -> list[_Slope]:
    """Central differences at the accepted steps, coarsest first."""
    found: list[_Slope] = []
    for step in steps:
        ahead = line(step)
        behind = None if ahead is None else line(-step)
        if ahead is None or behind is None:
            found.clear()  # coarser steps may cross to another branch beyond a refused step
            continue
        rounding = eps * float(np.linalg.norm(ahead)) / step
        found.append(_Slope(step, float(np.sum(ahead - behind)) / (2 * step), rounding))
        if settle and len(found) >= 3:
            _, coarse, fine = found[-3:]
            values = [_five_point(*pair) for pair in ((found[-3], coarse), (coarse, fine))]
            if abs(values[1] - values[0]) <= SETTLED * abs(values[1]):
                break
    return found


def _five_point(coarse: _Slope, fine: _Slope) -> float:
    """Cancel the h^2 term of two central differences."""
    square = (coarse.step / fine.step) ** 2
    return (square * fine.central - coarse.central) / (square - 1)


def _best(slopes: list[_Slope]) -> Difference | None:
    if len(slopes) < 3:
        return None
    values = [_five_point(*pair) for pair in pairwise(slopes)]
    gaps = [abs(b - a) for a, b in pairwise(values)]  # gaps[k] belongs to step k + 2
    k = int(np.argmin(gaps))
    step = slopes[k + 2].step
    # Truncation shrinks with the step, noise grows as 1/h: finer steps bound the noise of this one.
    noise = max(gap * slopes[j + 2].step / step for j, gap in enumerate(gaps) if j >= k)
    return Difference(values[k + 1], 2 * max(noise, slopes[k + 2].rounding), step)


class Taylor(NamedTuple):
    """Slope of log |remainder| over log h, and whether the function is linear to rounding (then slope = inf)."""

    slope: float
    linear: bool

    @property
    def passed(self) -> bool:
        """Second order or better. A wrong first derivative gives slope 1."""
        return self.linear or self.slope >= 1.9


def taylor_slope(line: Line, derivative: float) -> Taylor:
    """Order of |f(h) - f(0) - h f'(0)| between the two finest steps where it clearly exceeds rounding.

    The remainder of a correct derivative falls as h^2 or faster; with a wrong derivative it falls as h.
    """
    origin = line(0.0)
    if origin is None:
        raise ValueError("the line has no value at 0")
    clear = 1e4 * float(np.finfo(np.float64).eps) * float(np.linalg.norm(origin))
    points: list[tuple[float, float]] = []
    for step in LADDER:
        ahead = line(step)
        remainder = 0.0 if ahead is None else abs(float(np.sum(ahead - origin)) - step * derivative)
        if remainder > clear:
            points.append((step, remainder))
    if len(points) < 2:
        return Taylor(np.inf, linear=True)
    (coarse, above), (fine, below) = points[-2:]
    return Taylor(float(np.log(above / below) / np.log(coarse / fine)), linear=False)
