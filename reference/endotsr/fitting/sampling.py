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


class View(NamedTuple):
    """The time that one iteration renders and the frame that the render is compared with."""

    index: int  # frame number, always one of the training frames
    t: float  # normalised time at which the scene is rendered


def draw_view(rng: np.random.Generator, sequence: Sequence, training: TrainingConfig) -> View:
    """A training frame, uniform with replacement, and its time (jittered or bridged if the settings say so).

    Draws: `rng.random()` if views are bridged, then `rng.integers` and, with jitter, `rng.uniform`; a bridged view
           draws as `_draw_bridge` does.
    """
    if training.bridge_fraction > 0 and rng.random() < training.bridge_fraction:
        return _draw_bridge(rng, sequence)
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
