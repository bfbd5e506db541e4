"""The measurement of a large scene, with a small one."""

import pytest
from large import many_gaussians, many_threads

pytestmark = pytest.mark.faults


def test_every_point_that_was_asked_for_becomes_a_gaussian(tmp_path):
    found = many_gaussians(900, 3, 64, 48, tmp_path)
    assert found["gaussians"] == 900
    assert found["peak_bytes"] > 5e7 and found["checkpoint_bytes"] > 900 * 59 * 4


def test_more_threads_than_cores_give_the_same_bits(tmp_path):
    assert many_threads(5, tmp_path)["threads"] == 5
