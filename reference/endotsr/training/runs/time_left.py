"""The time left of a training, from the time of its latest iterations and of the targets made up to now.

In: the settings, the numbers of frames, and what each iteration took. Out: seconds. The work on targets between the
frames is no part of the time of an iteration: it is counted separately, and ends when every gap has its targets.
"""

import math
import statistics
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from endotsr.clips.sequences.forecast.seconds import TimedCommand, gap_units, visited
from endotsr.clips.sequences.forecast.work import PIXELS, Standing, coarse_end, iteration_work, work_left
from endotsr.training.fitting.records import NOTHING_MADE, Making

LEAST_ITERATIONS, MOST_ITERATIONS = 5, 200  # number of timed iterations
# Of a long run, this fraction is remembered instead: other programs can slow a machine for half a minute, and 200
# iterations of a large scene take no longer than that.
REMEMBERED = 0.125
SPIKE = 4.0  # medians; longer iterations are left out, such as those that compiled or loaded code
# Seconds, times the threads, by which one second of the second thread prolongs the iterations: 0.82 and 0.83 on two
# cores (AMD EPYC), in the first 100 iterations of `sharp` on EndoNeRF cutting, two runs; 0.67 to 0.79 on an Intel Xeon
# with full frames and 0.52 to 0.63 with half ones, four runs of `quick` on pulling. A guess at the cause: of three
# threads on two cores, a parallel loop waits for the one that shares a core.
SLOWED = 1.6
# Weights of known speeds: timed before, beside the second thread, in a coarse start. On one run each of `quick` on two
# recorded clips and a simulated one, the largest rise of the time left was 9 % with these weights, 10 % with equal ones
# and 8 or 9 % with five other choices, some of them with another SLOWED or LEAST_QUIET.
BEFORE, BESIDE, COARSE = 2.0, 0.5, 1.0
LEAST_QUIET = 8  # iterations without the second thread; that many full ones have the weight 1
PATIENCE = 30.0  # seconds for which these are awaited on a machine without a speed; the time left is unknown until then
# Iterations of a coarse start, or beside the second thread, after which more add no weight. A coarse start is checked
# once in that many, and such an iteration took up to 3.7 times as long.
MANY = 50
QUIET_AFTER, QUIET_BEFORE = 1, 8  # iterations of the distance to the last finished target, and to the next one
PIXELS_OF_FULL = 4  # times those of a frame of a coarse start
# Weight of the time expected of a gap, in gaps. The first ones are no measure: after the coarse start of `quick` on
# EndoNeRF pulling, two of them took 0.38 s each, and all of them 0.22 s on average.
EXPECTED_GAPS = 10


class Timed(NamedTuple):
    """One iteration."""

    seconds: float  # without waiting
    work: float
    waited: float  # seconds for targets
    beside: float  # seconds of the second thread
    coarse: bool = False  # with frames of half size


class TimeLeft:
    """Collects the time of iterations and targets."""

    def __init__(self, plan: TimedCommand) -> None:
        self._plan = plan
        most = max(MOST_ITERATIONS, round(REMEMBERED * plan.config.training.iterations))
        self._timed: deque[Timed] = deque(maxlen=most)
        self._coarse, self._making = False, NOTHING_MADE
        self._expected: float | None = None  # seconds of a gap, by those of the size before
        self._seconds = 0.0  # of all iterations

    def add(self, standing: Standing, seconds: float, making: Making) -> None:
        """An iteration took this time, with the work on targets since the previous one.

        standing  after the iteration, with the size of its frames
        making    the work on targets of this size up to now
        """
        before = self._making if standing.coarse == self._coarse else NOTHING_MADE
        if standing.coarse != self._coarse and self._making.gaps:
            self._expected = PIXELS_OF_FULL * (self._making.waited + self._making.beside) / self._making.gaps
        self._coarse, self._making = standing.coarse, making
        waited, beside = making.waited - before.waited, making.beside - before.beside
        progress = standing.iteration / self._plan.config.training.iterations
        work = iteration_work(standing.gaussians, self._seen(standing.coarse), progress, self._plan.vectors)
        self._seconds += seconds
        self._timed.append(Timed(max(seconds - waited, 0.0), float(work), waited, beside, standing.coarse))

    @property
    def unit(self) -> float | None:
        """Seconds per unit of work, as the geometric mean of several speeds; None = too few iterations up to now.

        These are the speed that was timed before, that of the iterations beside the second thread, that of a coarse
        start without it, and that of full frames without it. The second was wrong by a fifth in one run, and the third
        differed by a quarter between two runs on a clip; the weight of the last one grows with its iterations.
        """
        before, near = self._plan.unit, near_targets(self._timed) if self._plan.threads > 1 else set()
        beside = [one for k, one in enumerate(self._timed) if k in near]
        halves, whole = ([one for k, one in enumerate(self._timed) if k not in near and one.coarse == coarse]
                         for coarse in (True, False))  # fmt: skip
        if before is None and beside and len(halves) + len(whole) < LEAST_QUIET and self._seconds < PATIENCE:
            return None
        own = [
            (BESIDE * min(len(beside) / MANY, 1.0), unit_seconds(beside, SLOWED / self._plan.threads)),
            (COARSE * min(len(halves) / MANY, 1.0), unit_seconds(halves)),
            (len(whole) / LEAST_QUIET, unit_seconds(whole)),
        ]
        known = [(weight, math.log(unit)) for weight, unit in own if unit is not None]
        if not known:
            return None
        if before is not None:
            known.append((BEFORE, math.log(within(self._timed, before))))
        return math.exp(sum(weight * unit for weight, unit in known) / sum(weight for weight, _ in known))

    def seconds(self, standing: Standing) -> float | None:
        """Seconds from here to the end of the iterations; None = speed or end of a coarse start is unknown."""
        unit = self.unit
        if unit is None or (standing.coarse and not standing.coarse_until):
            return None
        plan = self._plan
        return unit * work_left(plan.config, plan.pixels, standing, plan.vectors) + self._targets(unit, standing)

    def _targets(self, unit: float, standing: Standing) -> float:
        """Seconds that targets will add, at this size of the frames and, during a coarse start, at full size."""
        config, frames, made = self._plan.config, self._plan.frames, self._making
        each = self._expected or self._plan.alone(unit) * gap_units(frames) * self._seen(standing.coarse) / PIXELS
        each = (EXPECTED_GAPS * each + made.waited + made.beside) / (EXPECTED_GAPS + made.gaps)
        end = config.training.iterations
        until = min(coarse_end(config, standing), end) if standing.coarse else end
        missing = max(frames.gaps - made.gaps, 0) * visited(config, frames.gaps, until - standing.iteration)
        if standing.coarse:
            missing += PIXELS_OF_FULL * frames.gaps * visited(config, frames.gaps, end - until)
        return each * missing / self._plan.threads

    def _seen(self, coarse: bool) -> float:
        return self._plan.pixels / 4 if coarse else self._plan.pixels


def unit_seconds(timed: Iterable[Timed], slowed: float = 0.0) -> float | None:
    """Seconds per unit of work, without the iterations beyond SPIKE medians; None = too few iterations.

    slowed   seconds that one of the second thread costs the iterations, unless these wait for targets meanwhile

    Edges:   at least half of the fastest iteration, which shares a core at most; the work of the second thread is known
             by target, not by iteration.
    """
    known = list(timed)
    if len(known) < LEAST_ITERATIONS:
        return None
    each = [one.seconds / one.work for one in known]
    limit = SPIKE * statistics.median(each)
    kept = [one for one, unit in zip(known, each) if unit <= limit]
    lost = slowed * max(sum(one.beside - one.waited for one in kept), 0.0)
    return max((sum(one.seconds for one in kept) - lost) / sum(one.work for one in kept), min(each) / 2)


def within(timed: Iterable[Timed], before: float) -> float:
    """Seconds per unit of work, as timed before, if the iterations do not contradict it.

    Edges:   the median iteration at most, since a second thread makes none faster, and half of the fastest at least
    """
    each = [one.seconds / one.work for one in timed]
    return max(min(before, statistics.median(each)), min(each) / 2)


def near_targets(timed: Iterable[Timed]) -> set[int]:
    """The positions of iterations beside the second thread: a target is finished in them, just before or soon after."""
    made = [k for k, one in enumerate(timed) if one.beside or one.waited]
    return {k for at in made for k in range(at - QUIET_BEFORE, at + QUIET_AFTER + 1)}
