"""Which frame an iteration sees, and at which time: uniform, jittered, bridged."""

from types import SimpleNamespace

import msgspec
import numpy as np

from endotsr.config import PAPER
from endotsr.fitting.sampling import draw_view, next_view

TRAIN = np.array([0, 2, 3, 4, 7])


def _draws(count: int, **training):
    config = msgspec.structs.replace(PAPER, training=msgspec.structs.replace(PAPER.training, **training))
    sequence = SimpleNamespace(train_index=TRAIN, times=np.arange(8) / 8, count=8)
    rng, drawn = np.random.default_rng(3), []
    for _ in range(count):
        expected = next_view(rng, sequence, config.training)  # type: ignore[arg-type]
        drawn.append(draw_view(rng, sequence, config.training))  # type: ignore[arg-type]
        assert drawn[-1] == expected  # and the look ahead has drawn nothing
    return np.array([d[0] for d in drawn]), np.array([d[1] for d in drawn])


def test_plain_views_are_training_frames_at_their_own_times():
    index, t = _draws(2000)
    assert set(index) == set(TRAIN)
    np.testing.assert_array_equal(t, index / 8)
    assert np.bincount(index, minlength=8)[TRAIN].min() > 300  # uniform: 400 each


def test_jitter_stays_within_half_a_frame_and_fills_it():
    index, t = _draws(2000, time_jitter=1.0)
    offset = (t - index / 8) * 8
    assert offset.min() < -0.45 and offset.max() > 0.45 and np.abs(offset).max() <= 0.5


def test_bridged_views_blend_the_two_training_neighbours_linearly():
    index, t = _draws(20000, bridge_fraction=1.0)
    times = TRAIN / 8
    right = np.clip(np.searchsorted(times, t, side="right"), 1, 4)
    assert np.all((index == TRAIN[right]) | (index == TRAIN[right - 1]))  # a neighbour, never another frame
    assert t.min() >= 0 and t.max() <= 7 / 8
    # the mean frame number of the targets equals the time they are compared at, in every stretch of time
    for low in np.arange(0, 7, 0.5):
        here = (t * 8 >= low) & (t * 8 < low + 0.5)
        assert abs(index[here].mean() - t[here].mean() * 8) < 0.15
