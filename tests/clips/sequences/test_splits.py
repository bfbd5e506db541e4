"""Held-out frames."""

import numpy as np
import pytest

from endotsr.clips.sequences.splits import blocks, end_of_clip, every_eighth, split_frames
from endotsr.errors import InputError


@pytest.mark.parametrize(("count", "train", "test"), [(63, 55, 8), (156, 136, 20), (100, 87, 13), (200, 175, 25)])
def test_every_eighth_has_the_published_sizes(count, train, test):
    training, held_out = every_eighth(count)
    assert (len(training), len(held_out)) == (train, test)
    assert training[0] == 0 and list(held_out[:3]) == [1, 9, 17]


@pytest.mark.parametrize("length", [1, 2, 4, 8, 16])
def test_blocks_have_their_length_and_training_frames_on_both_sides(length):
    training, held_out = blocks(63, length)
    starts = held_out[::length]
    np.testing.assert_array_equal(held_out, (starts[:, None] + np.arange(length)).ravel())
    assert set(starts - 1) <= set(training) and set(starts + length) <= set(training)
    assert (np.diff(starts) == max(24, 2 * length)).all()
    np.testing.assert_array_equal(np.sort(np.concatenate([training, held_out])), np.arange(63))


def test_blocks_of_eight_in_63_frames():
    np.testing.assert_array_equal(blocks(63, 8)[1], [*range(8, 16), *range(32, 40)])
    blocks(17, 8)
    with pytest.raises(InputError, match="at least 17 frames"):
        blocks(16, 8)


def test_every_second_frame_halves_the_frame_rate():
    training, held_out = split_frames(9, "every_second", 8)
    assert list(training) == [0, 2, 4, 6, 8] and list(held_out) == [1, 3, 5, 7]


def test_the_end_is_held_out_whole():
    training, held_out = split_frames(20, "end", 8)
    assert list(training) == list(range(12)) and list(held_out) == list(range(12, 20))
    assert list(end_of_clip(10, 8)[0]) == [0, 1]
    with pytest.raises(InputError, match="8 held-out frames of 9; at least 2 are needed for training"):
        split_frames(9, "end", 8)


def test_too_few_frames_are_refused():
    with pytest.raises(InputError, match="2 frames are too few"):
        split_frames(2, "every_eighth", 8)
    training, held_out = split_frames(3, "every_eighth", 8)
    assert list(training) == [0, 2] and list(held_out) == [1]
