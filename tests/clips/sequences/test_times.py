"""Times of frames: normalised ones end before 1, and the rate is that of most steps."""

import numpy as np
import pytest

from endotsr.clips.sequences.times import evenly_spaced, normalised_times, time_stamps, usual_rate


def test_time_never_reaches_one():
    assert list(time_stamps(4)) == [0.0, 0.25, 0.5, 0.75]


def test_uneven_times_keep_their_proportions_and_end_where_even_ones_do():
    found = normalised_times(np.array([10.0, 11.0, 14.0]), 3)
    np.testing.assert_allclose(found, [0.0, 1 / 6, 2 / 3], rtol=1e-15)
    np.testing.assert_array_equal(normalised_times(None, 3), time_stamps(3))


def test_a_tenth_of_a_step_is_even_and_more_is_not():
    even = np.arange(5.0)
    assert evenly_spaced(even + [0, 0.05, 0, -0.05, 0]) and not evenly_spaced(even + [0, 0.2, 0, 0, 0])


@pytest.mark.parametrize(
    ("times", "rate"), [([0.0, 0.5, 1.0, 3.0], 2.0), ([0.0], None), ([], None), ([1.0, 1.0, 1.0, 2.0], None)]
)
def test_the_rate_is_that_of_the_median_step(times, rate):
    """A pause counts no more than one step; one time, and times that mostly stand still, have no rate."""
    assert usual_rate(np.array(times)) == rate
