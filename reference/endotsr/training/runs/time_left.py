"""The time left of a training, from the time of its latest iterations and of the targets made up to now.

In: the settings, the numbers of frames, and what each iteration took. Out: seconds. The work on targets between the
frames is no part of the time of an iteration: it is counted separately, and ends when every gap has its targets.
"""

import statistics
from collections import deque
from collections.abc import Iterable

from endotsr.clips.sequences.checks.duration import (
    PIXELS,
    Standing,
    TimedCommand,
    coarse_end,
    gap_units,
    iteration_work,
    visited,
    work_left,
)
from endotsr.training.fitting.records import NOTHING_MADE, Making

LEAST_ITERATIONS, MOST_ITERATIONS = 5, 200  # number of timed iterations
# Of a long run, this fraction is remembered instead: other programs can slow a machine for half a minute, and 200
# iterations of a large scene take no longer than that.
REMEMBERED = 0.125
SPIKE = 4.0  # medians; longer iterations compiled or loaded code and are left out; a coarse check takes three


class TimeLeft:
    """Collects the time of iterations and targets."""

    def __init__(self, plan: TimedCommand) -> None:
        self._plan = plan
        most = max(MOST_ITERATIONS, round(REMEMBERED * plan.config.training.iterations))
        self._seconds: deque[float] = deque(maxlen=most)  # per unit of work, without waiting
        self._waited: deque[float] = deque(maxlen=LEAST_ITERATIONS)  # per unit of work, of iterations that waited
        self._coarse, self._making = False, NOTHING_MADE

    def add(self, standing: Standing, seconds: float, making: Making) -> None:
        """An iteration took this time, with the work on targets since the previous one.

        standing  after the iteration, with the size of its frames
        making    the work on targets of this size up to now
        """
        before = self._making if standing.coarse == self._coarse else NOTHING_MADE
        self._coarse, self._making = standing.coarse, making
        seconds -= making.waited - before.waited + (making.beside - before.beside) / self._plan.threads
        progress = standing.iteration / self._plan.config.training.iterations
        work = iteration_work(standing.gaussians, self._seen(standing.coarse), progress, self._plan.vectors)
        waited = making.waited > before.waited  # such an iteration finds cold caches
        (self._waited if waited else self._seconds).append(max(seconds, 0.0) / float(work))

    @property
    def unit(self) -> float | None:
        """Seconds per unit of work; None = too few iterations."""
        return unit_seconds(self._seconds) or unit_seconds(self._waited)

    def seconds(self, standing: Standing) -> float | None:
        """Seconds from here to the end of the iterations; None = too few iterations."""
        unit = self.unit
        if unit is None:
            return None
        plan = self._plan
        return unit * work_left(plan.config, plan.pixels, standing, plan.vectors) + self._targets(unit, standing)

    def _targets(self, unit: float, standing: Standing) -> float:
        """Seconds that targets will add, at this size of the frames and, during a coarse start, at full size."""
        config, frames, made = self._plan.config, self._plan.frames, self._making
        each = self._plan.alone(unit) * gap_units(frames) * self._seen(standing.coarse) / PIXELS
        if made.gaps:
            each = (made.waited + made.beside) / made.gaps
        end = config.training.iterations
        until = min(coarse_end(config, standing), end) if standing.coarse else end
        missing = max(frames.gaps - made.gaps, 0) * visited(config, frames.gaps, until - standing.iteration)
        if standing.coarse:
            missing += 4 * frames.gaps * visited(config, frames.gaps, end - until)
        return each * missing / self._plan.threads

    def _seen(self, coarse: bool) -> float:
        return self._plan.pixels / 4 if coarse else self._plan.pixels


def unit_seconds(seconds: Iterable[float]) -> float | None:
    """Mean seconds per unit of work, without iterations that compiled code; None = too few iterations.

    seconds   of the latest iterations, each divided by its work
    """
    known = list(seconds)
    if len(known) < LEAST_ITERATIONS:
        return None
    limit = SPIKE * statistics.median(known)
    return statistics.fmean(s for s in known if s <= limit)
