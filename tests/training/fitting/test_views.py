"""Which frame an iteration sees, and at which time: uniform, or a moment between two frames."""

from types import SimpleNamespace

import msgspec
import numpy as np

from endotsr.config import PAPER
from endotsr.training.fitting.sampling import drawn_view

TRAIN = np.array([0, 2, 3, 4, 7])


def _draws(count: int, **training):
    config = msgspec.structs.replace(PAPER, training=msgspec.structs.replace(PAPER.training, **training))
    sequence = SimpleNamespace(train_index=TRAIN, times=np.arange(8) / 8, count=8)
    rng, drawn = np.random.default_rng(3), []
    for _ in range(count):
        view, before = drawn_view(rng, sequence, config.training)  # type: ignore[arg-type]
        again = np.random.default_rng(3)
        again.bit_generator.state = before
        assert drawn_view(again, sequence, config.training).view == view  # type: ignore[arg-type]
        drawn.append(view)
    return np.array([d[0] for d in drawn]), np.array([d[1] for d in drawn])


def test_plain_views_are_training_frames_at_their_own_times():
    index, t = _draws(2000)
    assert set(index) == set(TRAIN)
    np.testing.assert_array_equal(t, index / 8)
    assert np.bincount(index, minlength=8)[TRAIN].min() > 300  # uniform: 400 each


def test_the_fraction_of_bridged_views_is_that_of_the_settings():
    index, t = _draws(4000, bridge_fraction=0.25)
    between = t != index / 8
    assert abs(between.mean() - 0.25) < 0.03
    assert t.min() >= 0 and t.max() <= 7 / 8 and set(index) == set(TRAIN)
    assert np.abs(t * 8 - index)[between].max() <= 1.5  # the nearer frame of a gap of three at most


def test_one_training_frame_has_no_time_to_bridge():
    sequence = SimpleNamespace(train_index=TRAIN[1:2], times=np.arange(8) / 8, count=8)
    training = msgspec.structs.replace(PAPER.training, bridge_fraction=1.0)
    view, _ = drawn_view(np.random.default_rng(3), sequence, training)  # type: ignore[arg-type]
    assert view == (2, 2 / 8, None)


def test_midway_between_two_frames_the_earlier_is_the_nearer():
    index, t = _draws(4000, bridge_fraction=1.0)
    halves = np.array([1, 2.5, 3.5, 5.5])
    for earlier, place in zip(TRAIN, halves):
        assert set(index[np.isclose(t * 8, place)]) == {earlier}
