"""The clock of a recording: even, uneven, going back, jumping."""

import numpy as np
import pytest

from endotsr.clips.formats.clocks import clock_of

EVEN = 3.0 + np.arange(50) / 25


def test_an_even_clock_counts_from_the_first_picture():
    found = clock_of(EVEN, None)
    np.testing.assert_allclose(found.times, np.arange(50) / 25, atol=1e-12)
    assert found.rate == pytest.approx(25) and found.stands and not found.remark


@pytest.mark.parametrize("stamps", [[0.0], [0.0, np.nan, 0.2], [0.0, 0.0, 0.0]])
def test_without_stamps_the_stated_rate_remains(stamps):
    assert clock_of(np.array(stamps), 30.0)[:2] == (None, 30.0)
