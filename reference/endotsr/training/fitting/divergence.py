"""Divergence checks: a non-finite number stops a training before any parameter update; a rising loss gives a warning.

In: gradients and losses of an iteration. Out: the exception `Diverged` with iteration, frame and term, and warnings
with advice. The checks change no number of the training. They search eleven numbers per Gaussian, and every hundred
iterations the distances of the centres.
"""

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from endotsr.method.kernels.arrays import FloatArray
from endotsr.training.fitting.records import LogEntry, RngState
from endotsr.training.scene.gaussians import Gaussians

WINDOW = 100  # iterations of a mean of the loss, and between two checks of the centres
RISE = 3.0  # times the lowest mean so far
FAR_OFF = 10.0  # times the radius of the scene as the training is started or resumed
FAR_OFF_FRACTION = 0.01  # of the Gaussians
WATCHED_TERM = "l1"  # its weight is constant, unlike the weight of the Laplacian loss
ADVICE = (
    "smaller rates may help (--optimiser.position, --optimiser.deformation, --optimiser.scale), "
    "and so may a look at the unit of the depth and at the poses"
)


class Diverged(FloatingPointError):
    """An iteration with a non-finite loss or gradient. It has changed no parameter."""

    def __init__(self, iteration: int, frame: int, term: str, found: str, rng_state: RngState) -> None:
        super().__init__(f"iteration {iteration}, frame {frame}: {term} is {found}")
        self.iteration, self.frame, self.term = iteration, frame, term
        self.rng_state = rng_state  # before the iteration, to repeat it


def not_finite(gradients: Mapping[str, FloatArray | None]) -> tuple[str, str] | None:
    """Name, index and value of the first non-finite number, as ("d_position[1, 7]", "nan"); None if there is none.

    No function of a BLAS library takes part (`dot` of the squares): after a call its threads may wait actively for the
    next one, on the cores of the kernels.
    """
    for name, array in gradients.items():
        if array is None or np.isfinite(array).all():
            continue
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        return f"{name}[{', '.join(map(str, index))}]", str(array[index])
    return None


class DivergenceWatch:
    """Monitors a training and returns one warning per sign of divergence."""

    def __init__(self, gaussians: Gaussians) -> None:
        self._centre, self._radius = _extent(gaussians)
        self._recent: deque[float] = deque(maxlen=WINDOW)
        self._lowest = math.inf
        self._said: set[str] = set()

    def see(self, entry: LogEntry, gaussians: Gaussians) -> str:
        """The warning after the iteration of this log entry, or an empty string."""
        self._recent.append(entry.get(WATCHED_TERM, entry["loss"]))
        if entry["iteration"] % WINDOW or len(self._recent) < WINDOW:
            return ""
        mean = math.fsum(self._recent) / WINDOW
        lowest, self._lowest = self._lowest, min(self._lowest, mean)
        where = f"iteration {entry['iteration']}: "
        if mean > RISE * lowest and self._first("loss"):
            rise = f"the mean colour loss of {WINDOW} iterations is {mean / lowest:.1f} times the lowest before"
            return f"{where}{rise}; {ADVICE}"
        fraction = self._far_off(gaussians)
        if fraction > FAR_OFF_FRACTION and self._first("far off"):
            away = f"{fraction:.0%} of the Gaussians are over {FAR_OFF:g} times the radius of the scene from its centre"
            return f"{where}{away}; {ADVICE}"
        return ""

    def _first(self, kind: str) -> bool:
        new = kind not in self._said
        self._said.add(kind)
        return new

    def _far_off(self, gaussians: Gaussians) -> float:
        """Fraction of the centres that are more than FAR_OFF radii from the centre of the scene along an axis."""
        if not gaussians.count:
            return 0.0
        away = np.abs(gaussians.position - self._centre[:, None]).max(axis=0)
        return float(np.count_nonzero(~(away <= FAR_OFF * self._radius))) / gaussians.count


def _extent(gaussians: Gaussians) -> tuple[FloatArray, float]:
    """Median centre, and the largest distance from it along an axis. (3,) and a length > 0, scene units."""
    if not gaussians.count:
        return np.zeros(3), math.inf
    centre = np.median(gaussians.position, axis=1)
    return centre, max(float(np.abs(gaussians.position - centre[:, None]).max()), 1e-30)
