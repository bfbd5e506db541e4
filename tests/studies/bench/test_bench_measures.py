"""What the benchmarks count and fit; no test looks at a time."""

import threading
import time
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, replace

import numba
import numpy as np
import pytest
from pages.bench import scaling

from endotsr.config import PAPER
from endotsr.method.kernels.timer import NO_TIMER, timed
from endotsr.studies.bench import clock, peaks
from endotsr.studies.bench.case import BenchCase, measure, prepare, representative
from endotsr.studies.bench.clock import STAGES
from endotsr.studies.bench.limits import limits, work
from endotsr.training.fitting import trainer
from endotsr.training.fitting.schedules import densify_now
from endotsr.training.scene import workload
from endotsr.training.scene.gaussians import arrays

pytestmark = pytest.mark.slow

TINY = BenchCase(gaussians=60, width=48, height=32, repeats=2, threads=1, densifications=1)
PEAKS = {"flop_per_second": {"float32": 1e11, "float64": 5e10}, "bytes_per_second": {"triad": 1e10, "update": 2e10}}


@pytest.fixture(scope="module")
def result():
    return measure(TINY)


def test_every_stage_takes_time(result):
    assert set(result["stages"]) == {*clock.STAGES, clock.REST}
    idle = [name for name, spread in result["stages"].items() if not spread["median_ms"] > 0]
    assert not idle, f"no time was counted for {idle}: are they still announced?"
    assert result["densification"]["gaussians"] > 0 and result["view"]["blended"] > 0
    assert result["parameters"] == 665  # of a Gaussian at B = 17, F = 8, degree 3


def test_stages_that_the_training_announces_are_those_of_the_clock():
    """A stage that is announced but not listed would be lost; one that is listed but not announced would show 0."""
    announced = []

    class Recorder:
        @contextmanager
        def stage(self, name):
            announced.append((name, threading.get_ident()))
            yield

    config = TINY.config()
    state, constants = prepare(TINY, config)
    numba.set_num_threads(1)
    trainer.training_step(state, constants, Recorder())
    names = [name for name, _ in announced]
    assert set(names) == set(clock.STAGES)
    splat = [name for name in names if name in clock.SPLAT]
    assert splat == ["projection", "binning", "blend forward", "blend reverse", "binning", "projection"]


def test_a_timer_changes_no_result():
    config = TINY.config()
    results = []
    for timer in (NO_TIMER, clock.StageClock()):
        state, constants = prepare(TINY, config)
        with timer.iteration() if isinstance(timer, clock.StageClock) else nullcontext():
            entry = trainer.training_step(state, constants, timer)
        results.append((entry, state.gaussians))
    (entry, gaussians), (other_entry, others) = results
    assert entry == other_entry
    for name, array in arrays(gaussians).items():
        assert np.array_equal(array, getattr(others, name)), name


def test_a_stage_ends_when_its_work_fails():
    watch = clock.StageClock()
    with watch.iteration():
        with pytest.raises(ZeroDivisionError):
            timed(watch, "binning", lambda: 1 // 0)()
        with pytest.raises(KeyError, match=r"unknown stage 'sorting'; use one of FDM, .*density control"):
            timed(watch, "sorting", lambda: None)()
        time.sleep(0.01)
    assert watch.repeats[0][clock.REST] > watch.repeats[0]["binning"]


@pytest.fixture
def watch(monkeypatch):
    """A clock whose six readings are 1, 2, 4, 8 and 16 s apart."""
    now = iter([0.0, 1.0, 3.0, 7.0, 15.0, 31.0])
    monkeypatch.setattr(clock.time, "perf_counter", lambda: next(now))
    return clock.StageClock()


def test_nested_stages_are_counted_once(watch):
    with watch.iteration(), watch.stage("projection"), watch.stage("binning"):
        pass
    found = watch.repeats[0]
    assert (found["projection"], found["binning"], found[clock.REST]) == (2.0 + 8.0, 4.0, 1.0 + 16.0)


def test_stages_of_two_threads_divide_the_time(watch):
    with watch.iteration(), watch.stage("projection"):
        other = threading.Thread(target=timed(watch, "binning", lambda: None))
        other.start()
        other.join()
    found = watch.repeats[0]
    assert (found["projection"], found["binning"], found[clock.REST]) == (2.0 + 2.0 + 8.0, 2.0, 1.0 + 16.0)


def test_representative_iteration_has_everything_but_densification():
    iteration = representative(PAPER) + 1
    assert iteration > max(PAPER.training.residual_activation, PAPER.loss.laplacian_full)
    assert not densify_now(iteration, PAPER)


def test_exponent_is_that_of_the_upper_decade():
    size = [1.0, 3, 10, 30, 100]
    times = [7.0 if x < 10 else 0.02 * x**1.5 for x in size]
    assert scaling.exponent(size, times) == pytest.approx(1.5)
    assert scaling.exponent([5.0, 5.0], [1.0, 2.0]) is None
    assert scaling.exponent([1.0, 2.0], [0.0, 1.0]) is None


def test_memory_is_a_slope():
    axis = {"size": [1.0, 10, 40, 100], "peak_memory_bytes": [5e8, 1e8 + 80, 1e8 + 320, 1e8 + 800]}
    assert scaling.memory({"gaussians": axis})["bytes_per_gaussian"] == pytest.approx(8)
    axis["peak_memory_bytes"][0] = None
    assert scaling.memory({"gaussians": axis})["bytes_per_gaussian"] is None


def test_faster_pass_counts_at_every_size(monkeypatch):
    """Sizes 1, 2, 3 up and down again; a neighbour is busy on the way up at 2 and on the way down at 1."""
    said, order = [], []
    times = iter([1.0, 9.0, 3.0, 3.5, 2.0, 8.0])

    def measured(_, case):
        order.append(case.gaussians)
        stages = {name: {"median_ms": next(times) if name == scaling.REST else 0.0} for name in (*STAGES, scaling.REST)}
        return {"case": asdict(case), "stages": stages, "parameters": 1, "peak_memory_bytes": None}

    axis = scaling.Axis(
        "Gaussians",
        tuple(replace(scaling.BASE, gaussians=n) for n in (1, 2, 3)),
        ("iteration",),
        lambda result: float(result["case"]["gaussians"]),
    )
    monkeypatch.setattr(scaling, "axes", lambda largest: {"gaussians": axis})
    monkeypatch.setattr(scaling, "apart", measured)
    monkeypatch.setattr(scaling, "line", lambda result: "")
    found = scaling.measure_scaling(3, ("gaussians",), said.append)["axes"]["gaussians"]
    assert order == [1, 2, 3, 3, 2, 1] and len(said) == 6
    assert found["size"] == [1, 2, 3] and found["median_ms"]["iteration"] == [1, 2, 3]


def test_every_axis_varies_its_size_alone():
    for name, axis in scaling.axes(10_000).items():
        assert len(axis.cases) > 2
        varied = [
            n for n in BenchCase.__dataclass_fields__ if n != "repeats" and len({getattr(c, n) for c in axis.cases}) > 1
        ]
        assert varied == {"pairs": ["size"], "pixels": ["width", "height"]}.get(name, [name])


def test_limit_is_the_longer_of_arithmetic_and_traffic(result):
    blend = work(result)["blend forward"]
    found = limits(result, PEAKS)["blend forward"]
    assert found["limit_ms"] == pytest.approx(1e3 * max(blend.flop / 1e11, blend.bytes / 2e10))
    assert set(limits(result, PEAKS)) == set(clock.STAGES)
    double = result | {"case": result["case"] | {"precision": "float64"}}
    assert work(double)["FDM"].bytes == 2 * work(result)["FDM"].bytes


def test_peaks_are_positive_numbers():
    found = peaks.bandwidths(repeats=1, array_bytes=1 << 20)
    assert set(found) == {"triad", "update"} and min(found.values()) > 0
    assert peaks.fma_peak("float32", repeats=1) > 0


def test_higher_peaks_are_kept():
    other = {"flop_per_second": {"float32": 2e11, "float64": 1e10}, "bytes_per_second": {"triad": 5e9, "update": 3e10}}
    kept = peaks.higher(PEAKS | {"threads": 2}, other)
    assert kept == {
        "threads": 2,
        "flop_per_second": {"float32": 2e11, "float64": 5e10},
        "bytes_per_second": {"triad": 1e10, "update": 3e10},
    }


def test_memory_kernels_do_what_they_say():
    out, left, right = np.full(5, 2.0), np.arange(5.0), np.arange(5.0) + 1
    peaks.triad(0, 1, out, left, right, 0.5)
    assert np.array_equal(out, left + 0.5 * right)
    peaks.update(0, 1, out, left, right, 2.0)
    assert np.array_equal(out, right + 2.0 * (left + 0.5 * right))


def test_median_and_quartiles():
    found = clock.spread([0.001, 0.002, 0.003, 0.004, 0.1])
    assert [found["median_ms"], *found["quartiles_ms"]] == pytest.approx([3.0, 2.0, 4.0])
    calls = []
    assert len(clock.repeated(lambda: calls.append(1), 3, warm_up=2)) == 3 and len(calls) == 5


def test_workload_is_seeded_and_grows_with_its_factor():
    first, second = workload.gaussians(50, PAPER), workload.gaussians(50, PAPER, size=2.0)
    assert np.array_equal(first.position, second.position)
    assert np.allclose(second.log_scale - first.log_scale, np.log(2), atol=1e-6)
    assert workload.sequence(16, 16, frames=3).count == 3
