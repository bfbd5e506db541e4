"""The clock of a recording: even, uneven, going back, jumping."""

import numpy as np
import pytest

from endotsr.clips.sequences.clocks import clock_of

EVEN = 3.0 + np.arange(50) / 25


def test_an_even_clock_counts_from_the_first_picture():
    found = clock_of(EVEN, None)
    np.testing.assert_allclose(found.times, np.arange(50) / 25, atol=1e-12)
    assert found.rate == pytest.approx(25) and found.stands and not found.remark


def test_a_pause_is_named_and_kept():
    stamps = EVEN + 1.5 * (np.arange(50) > 20)
    found = clock_of(stamps, None)
    assert found.stands and "jumps by 1.54 s after picture 20" in found.remark
    np.testing.assert_allclose(np.diff(found.times)[20], 1.54)


def test_a_jump_longer_than_all_pictures_is_no_clock():
    found = clock_of(EVEN + 95443.7 * (np.arange(50) > 20), None)  # 2^33 ticks of 90 kHz
    assert not found.stands and "jumps by" in found.remark


def test_a_clock_that_goes_back_is_no_clock_but_has_a_rate():
    found = clock_of(np.concatenate([EVEN, EVEN]), 50.0)
    assert found.times is None and found.rate == pytest.approx(25) and "--source-rate 25" in found.remark
    assert found.stands


@pytest.mark.parametrize("stamps", [[0.0], [0.0, np.nan, 0.2], [0.0, 0.0, 0.0]])
def test_without_stamps_the_stated_rate_remains(stamps):
    assert clock_of(np.array(stamps), 30.0)[:2] == (None, 30.0)


def test_dropped_frames_are_no_jump():
    found = clock_of(EVEN + 0.3 * (np.arange(50) > 20), None)
    assert found.remark == "" and found.times is not None
