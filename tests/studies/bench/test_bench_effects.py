"""`docs/make.py bench measure effects`: a part that is off costs what a build without it does."""

import numba
import numpy as np
import pytest
from pages.bench import effects as bench_effects
from pages.bench.effects import PARTS, benchmark_effects

from endotsr.method.kernels.threads import use_threads
from endotsr.training.fitting import objective


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """As the command: with several threads, it is chance whether two of them hold a buffer at the same time."""
    before = numba.get_num_threads()
    use_threads(1)
    yield
    use_threads(before)


@pytest.fixture(scope="module")
def result(one_thread):
    return benchmark_effects(gaussians=60, repeats=1, width=48, height=32)


def test_every_part_is_measured_with_its_memory(result):
    assert set(result["parts"]) == {part.name for part in PARTS}
    for name, part in result["parts"].items():
        assert part["memory_over_absent"] == 1.0, name
        assert part["allocated_over_absent"] == pytest.approx(1.0, abs=0.01), name
        assert part["allocated_bytes"]["off"] > 0 and part["off_ms"] > 0
    for name in ("deformation", "spectral_motion", "appearance", "harmonics"):
        assert result["parts"][name]["memory_saved"] > 0, name


def test_an_allocation_of_a_part_that_is_off_is_seen(monkeypatch):
    """A megabyte that only the build with the part allocates."""
    plain = bench_effects._step

    def wasteful(state, constants):
        waste = None if objective.normalised_depth_forward is None else np.ones(1 << 17)
        plain(state, constants)
        del waste

    monkeypatch.setattr(bench_effects, "_step", wasteful)
    part = next(part for part in PARTS if part.name == "depth")
    found = bench_effects._one(part, 60, 1, 48, 32, bench_effects.PAPER)
    assert found["allocated_over_absent"] > 1.2
