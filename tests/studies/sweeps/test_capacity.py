"""Workers and threads: no core and no memory is given out twice."""

import msgspec
import pytest

from endotsr.config import PAPER, SHARP
from endotsr.method.kernels.machine import memory_available, memory_of_machine
from endotsr.studies.sweeps.place import Size, capacity, run_bytes

FULL = Size(63, 640, 512)
RUN = run_bytes(FULL, PAPER)


@pytest.mark.parametrize("cores", [1, 2, 3, 8, 64])
@pytest.mark.parametrize("runs", [1, 3, 40])
@pytest.mark.parametrize("free", [1e9, 5e9, 24e9, 1e12])
def test_cores_and_memory_suffice(cores, runs, free):
    found = capacity([RUN] * runs, cores=cores, free=free)
    assert 1 <= found.workers <= min(runs, cores) and found.workers * found.threads <= cores
    assert found.workers == 1 or found.workers * RUN <= free


def test_the_largest_sequence_sets_the_memory():
    small = run_bytes(Size(63, 160, 128), PAPER)
    assert capacity([small] * 8, cores=8, free=8e9).workers > capacity([small] * 7 + [RUN], cores=8, free=8e9).workers


def test_what_is_asked_for_is_kept():
    assert capacity([RUN] * 9, cores=2, free=1e9, workers=3)[:2] == (3, 1)
    assert capacity([RUN] * 9, cores=8, free=1e12, threads=4)[:2] == (2, 4)


def test_a_run_of_full_size_needs_what_was_measured():
    """Runs of this size were measured at 1.7 (paper) and 2.3 GB (sharp)."""
    assert 1.7e9 < RUN < 2.6e9
    assert 2.3e9 < run_bytes(FULL, SHARP) < 3.5e9


def test_a_run_is_estimated_with_its_own_settings():
    few = msgspec.structs.replace(SHARP, density=msgspec.structs.replace(SHARP.density, maximum=1000))
    assert run_bytes(FULL, few) < run_bytes(FULL, SHARP)


def test_the_scale_is_that_of_the_size_already():
    half = msgspec.structs.replace(PAPER, sequence=msgspec.structs.replace(PAPER.sequence, scale=0.5))
    assert run_bytes(FULL, half) == RUN


def test_memory_of_this_machine_is_found():
    assert 1e6 < (memory_available() or 0.0) <= (memory_of_machine() or 0) < 1e15


def test_where_memory_is_unknown_little_is_assumed_and_said(monkeypatch):
    monkeypatch.setattr("endotsr.studies.sweeps.place.memory_available", lambda: None)
    found = capacity([RUN] * 9, cores=64)
    assert found.workers == 1 and found.reason.endswith("4.0 GB assumed: free memory is unknown")
