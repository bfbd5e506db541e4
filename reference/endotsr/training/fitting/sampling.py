"""Choice of the training frame and of the time of an iteration: uniform or bridged (specification, equation 6).

In: the random generator, the sequence and the training settings. Out: one `View`. Only the generator is changed.
"""

from typing import NamedTuple, cast

import numpy as np

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import TrainingConfig
from endotsr.training.fitting.records import RngState


class BridgedTime(NamedTuple):
    """A time between two consecutive training frames."""

    earlier: int  # frame number
    later: int  # frame number
    fraction: float  # position of the time between them, in (0, 1)


class View(NamedTuple):
    """The time of one iteration's render and the frame that it is compared with."""

    index: int  # frame number, always one of the training frames; the nearest one to a bridged time
    t: float  # normalised time at which the scene is rendered
    bridged: BridgedTime | None = None  # compared with the target at this time; None = with the frame


class Drawn(NamedTuple):
    """A view, and the state of the generator before its draw."""

    view: View
    rng_state: RngState


def drawn_view(rng: np.random.Generator, sequence: Sequence, training: TrainingConfig) -> Drawn:
    """The view of `draw_view`, with the state of the generator before the draw."""
    before = cast(RngState, dict(rng.bit_generator.state))
    return Drawn(draw_view(rng, sequence, training), before)


def draw_view(rng: np.random.Generator, sequence: Sequence, training: TrainingConfig) -> View:
    """A training frame, uniform with replacement; with probability `bridge_fraction` a time between two (B14).

    Draws: `rng.random()` if views are bridged, then one `rng.integers`.
    Edges: with one training frame there is no time to bridge.
    """
    bridging = training.bridge_fraction > 0 and rng.random() < training.bridge_fraction
    if bridging and len(sequence.train_index) > 1:
        return _draw_bridged(rng, sequence)
    index = int(sequence.train_index[rng.integers(len(sequence.train_index))])
    return View(index, float(sequence.times[index]))


def _draw_bridged(rng: np.random.Generator, sequence: Sequence) -> View:
    """One of the bridged times between the training frames (B14), uniform. Draws one `rng.integers`.

    A gap of g frames has the 2 g - 1 times k / (2 g): if the frames are evenly spaced, one at every missing frame and
    one midway between any two successive frames. Longer gaps are therefore drawn more often, and every time has one
    target.
    """
    train = sequence.train_index
    gaps = np.diff(train)
    last = np.cumsum(2 * gaps - 1)
    k = int(rng.integers(last[-1]))
    gap = int(np.searchsorted(last, k, side="right"))
    place = k - (int(last[gap - 1]) if gap else 0) + 1
    bridged = BridgedTime(int(train[gap]), int(train[gap + 1]), place / (2.0 * gaps[gap]))
    start, end = (float(sequence.times[i]) for i in bridged[:2])
    nearest = bridged.later if bridged.fraction > 0.5 else bridged.earlier
    return View(nearest, start + bridged.fraction * (end - start), bridged)
