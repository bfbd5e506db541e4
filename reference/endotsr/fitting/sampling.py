"""Choice of the training frame and of the time of an iteration: uniform, jittered or bridged (specification,
equation 6).

In: the random generator, the sequence and the training settings. Out: one `View`. This module is independent of the
Gaussians; it changes the generator only.
"""

import copy
from typing import NamedTuple

import numpy as np

from endotsr.config import TrainingConfig
from endotsr.sequences.sequence import Sequence


class Moment(NamedTuple):
    """A moment between two training frames that follow one another."""

    earlier: int  # frame number
    later: int  # frame number
    fraction: float  # where the moment lies between them, in (0, 1)


class View(NamedTuple):
    """The time that one iteration renders and the frame that the render is compared with."""

    index: int  # frame number, always one of the training frames; the nearest one to a moment
    t: float  # normalised time at which the scene is rendered
    moment: Moment | None = None  # compared with the target at this moment; None = with the frame


def draw_view(rng: np.random.Generator, sequence: Sequence, training: TrainingConfig) -> View:
    """A training frame, uniform with replacement, and its time (jittered or bridged if the settings say so).

    Draws: `rng.random()` if views are bridged, then `rng.integers` and, with jitter, `rng.uniform`; a bridged view
           draws as `_draw_bridge` or `_draw_moment` does.
    """
    if training.bridge_fraction > 0 and rng.random() < training.bridge_fraction:
        return _draw_moment(rng, sequence) if training.bridge_target == "flow" else _draw_bridge(rng, sequence)
    index = int(sequence.train_index[rng.integers(len(sequence.train_index))])
    t, jitter = float(sequence.times[index]), training.time_jitter
    return View(index, t + jitter * rng.uniform(-0.5, 0.5) / sequence.count if jitter > 0 else t)


def next_view(rng: np.random.Generator, sequence: Sequence, training: TrainingConfig) -> View:
    """The view that `draw_view` will return, from a copy of the generator; anything drawn before it changes that."""
    return draw_view(copy.deepcopy(rng), sequence, training)


def _draw_bridge(rng: np.random.Generator, sequence: Sequence) -> View:
    """A time uniform between the first and the last training frame, and one of its two training neighbours.

    The neighbour is drawn with the weight that linear interpolation would give it. The expected target at every time
    is therefore the blend of its neighbours, which constrains the scene between two frames.
    """
    index = sequence.train_index
    times = sequence.times[index]
    t = float(rng.uniform(times[0], times[-1]))
    right = min(max(int(np.searchsorted(times, t, side="right")), 1), len(times) - 1)
    nearness = (t - times[right - 1]) / (times[right] - times[right - 1])
    return View(int(index[right if rng.random() < nearness else right - 1]), t)


def _draw_moment(rng: np.random.Generator, sequence: Sequence) -> View:
    """One of the moments between the training frames (B14), uniform. Draws one `rng.integers`.

    A gap of g frames has the 2 g - 1 moments k / (2 g): a moment at every frame that is missing and half-way between
    any two frames. So every gap has its fraction of the draws by its length, and every moment has one target.
    """
    train = sequence.train_index
    gaps = np.diff(train)
    last = np.cumsum(2 * gaps - 1)
    k = int(rng.integers(last[-1])) if last.size else 0
    gap = int(np.searchsorted(last, k, side="right"))
    place = k - (int(last[gap - 1]) if gap else 0) + 1
    moment = Moment(int(train[gap]), int(train[gap + 1]), place / (2.0 * gaps[gap]))
    start, end = (float(sequence.times[i]) for i in moment[:2])
    nearest = moment.later if moment.fraction > 0.5 else moment.earlier
    return View(nearest, start + moment.fraction * (end - start), moment)
