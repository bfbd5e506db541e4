"""A short part of the fault campaign, with `-m faults`: one trial of each kind. The whole: campaign.py."""

import os

import campaign
import pytest
from file_layer import disk_full, operations, read_only

pytestmark = [
    pytest.mark.faults,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork"),
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return campaign.Bench(tmp_path_factory.mktemp("campaign") / "watched", seed=1)


@pytest.fixture(scope="module")
def total(bench):
    return campaign.count_operations(bench)


def test_the_layer_sees_the_checkpoints_and_the_log(total):
    assert total > 300


@pytest.mark.parametrize("by_time", [False, True])
def test_a_kill_at_a_moment(bench, by_time):
    assert campaign.kill_at_a_moment(bench, by_time)[0]


@pytest.mark.parametrize("fraction", [0.02, 0.5, 0.99])
def test_a_kill_inside_a_file_operation(fraction, bench, total):
    assert campaign.kill_at_an_operation(bench, total, round(fraction * total))[0]


@pytest.mark.parametrize("fraction", [0.01, 0.3, 0.9])
def test_a_full_disk(fraction, bench, total):
    assert campaign.fail_at_an_operation(bench, round(fraction * total), disk_full)[0]


def test_a_disk_that_stays_full(bench, total):
    assert campaign.fail_at_an_operation(bench, total // 2, disk_full, onwards=True)[0]


def test_a_folder_that_becomes_read_only(bench, total):
    assert campaign.fail_at_an_operation(bench, total // 3, read_only, onwards=True)[0]


@pytest.mark.parametrize(
    "fault", [campaign.two_processes, campaign.clock_jumps, campaign.sequence_changes, campaign.folder_vanishes]
)
def test_what_happens_around_a_run(fault, bench):
    assert fault(bench)[0]


def test_the_layer_fails_where_it_is_told_to(tmp_path):
    (tmp_path / "a").write_text("old")
    with pytest.raises(OSError, match="No space left"), operations(tmp_path, 2) as layer:
        (tmp_path / "a").write_text("new text")
    assert layer.count == 2 and (tmp_path / "a").read_text() == "new "
    assert (tmp_path / "a").write_text("again") == 5
