"""A part of a clip in place of all of it."""

import numpy as np
import pytest

from endotsr.clips.sequences.sampling import longest_run, reduced_to, runs_of, sampling_step, sparse_step


@pytest.mark.parametrize(("flags", "runs", "longest"), [
    ("0110111", [(1, 3), (4, 7)], (4, 7)), ("1100110", [(0, 2), (4, 6)], (0, 2)), ("1", [(0, 1)], (0, 1)),
    ("000", [], (0, 0)), ("", [], (0, 0)),
])  # fmt: skip
def test_runs_end_behind_their_last_entry_and_the_first_of_equal_ones_is_the_longest(flags, runs, longest):
    given = np.array([flag == "1" for flag in flags], bool)
    assert runs_of(given) == runs and longest_run(given) == longest


def test_steps_leave_a_part_of_each_picture():
    assert (sparse_step(127), sparse_step(128), sparse_step(255), sparse_step(1080)) == (1, 1, 1, 8)
    assert [sampling_step(np.zeros((side, 400, 3), np.uint8)) for side in (7, 20, 64, 400)] == [1, 2, 8, 8]


def test_the_longer_side_is_reduced_and_a_small_picture_is_left_as_it_is():
    picture = np.zeros((40, 100, 3), np.uint8)
    assert reduced_to(picture, 50).shape == (20, 50, 3) and reduced_to(picture, 100) is picture
