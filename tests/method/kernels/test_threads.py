"""Ranges of a kernel on several threads: every task once, errors reach the caller, forks and other threads work."""

import gc
import multiprocessing
import threading
import time
import weakref
from itertools import pairwise

import numba
import numpy as np
import pytest

from endotsr.method.kernels import threads as kernel_threads
from endotsr.method.kernels.jit import jit
from endotsr.method.kernels.threads import parallel_calls, parallel_for


def _count(first, stop, out):
    for i in range(first, stop):
        out[i] += 1


count = jit(_count)


@pytest.fixture(params=(1, 2))
def threads(request):
    if request.param > numba.config.NUMBA_NUM_THREADS:  # type: ignore[attr-defined]
        pytest.skip("one thread only (NUMBA_NUM_THREADS)")
    before = numba.get_num_threads()
    numba.set_num_threads(request.param)
    yield request.param
    numba.set_num_threads(before)


@pytest.mark.parametrize("tasks", [0, 1, 2, 3, 7, 8, 9, 1000])
def test_every_task_once(threads, tasks):
    out = np.zeros(tasks, np.int64)
    for _ in range(3):
        parallel_for(count, tasks, out)
    assert (out == 3).all()


class Recorder:
    """Stands for a compiled kernel: it has overloads."""

    def __init__(self, fail_at=None):
        self.ranges, self.fail_at, self.overloads = [], fail_at, {"one": None}

    def __call__(self, first, stop):
        self.ranges.append((first, stop))
        if self.fail_at is not None and first <= self.fail_at < stop:
            raise ValueError(f"task {self.fail_at}")


def test_ranges_make_up_the_whole(threads):
    recorder = Recorder()
    parallel_for(recorder, 37)
    ranges = sorted(recorder.ranges)
    assert ranges[0][0] == 0 and ranges[-1][1] == 37
    assert all(a[1] == b[0] for a, b in pairwise(ranges))
    assert ranges == ([(0, 37)] if threads == 1 else kernel_threads.ranges(37, threads))


def test_ranges_shrink_and_are_few():
    for tasks in (1, 2, 7, 320, 60_000):
        found = kernel_threads.ranges(tasks, 2)
        sizes = [stop - first for first, stop in found]
        assert sum(sizes) == tasks and sizes == sorted(sizes[:-1], reverse=True) + sizes[-1:]
        assert max(sizes) <= max(1, tasks // 4) and len(found) <= 2 * kernel_threads.RANGES_PER_THREAD


def test_errors_reach_the_caller_and_the_threads_live_on(threads):
    with pytest.raises(ValueError, match="task 30"):
        parallel_for(Recorder(fail_at=30), 37)
    test_every_task_once(threads, 100)


def test_undecorated_functions_run_here(threads):
    seen = []
    parallel_for(lambda first, stop: seen.append((first, stop, threading.current_thread())), 5)
    assert seen == [(0, 5, threading.current_thread())]


def test_calls_from_several_threads(threads):
    outs = [np.zeros(5000, np.int64) for _ in range(4)]
    callers = [
        threading.Thread(target=lambda out=out: [parallel_for(count, out.size, out) for _ in range(50)]) for out in outs
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert all((out == 50).all() for out in outs)


def test_results_of_calls_made_together_keep_their_order(threads):
    def call(k):
        out = np.zeros(500, np.int64)
        for _ in range(5):
            parallel_for(count, 500, out)
        time.sleep(0.001 * (3 - k % 3))
        return k, numba.get_num_threads(), (out == 5).all()

    for _ in range(5):
        assert parallel_calls(*(lambda k=k: call(k) for k in range(7))) == [(k, threads, True) for k in range(7)]
    assert parallel_calls() == []


def test_calls_made_together_run_at_the_same_time(threads):
    """Two calls that wait for each other end only if they run in two threads."""
    if threads == 1 or numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        pytest.skip("one after the other")
    meeting = threading.Barrier(2, timeout=20)
    assert sorted(parallel_calls(meeting.wait, meeting.wait)) == [0, 1]


def test_the_error_of_a_call_is_raised_after_all_have_ended(threads):
    ended = []

    def fail():
        raise ValueError("second")

    with pytest.raises(ValueError, match="second"):
        parallel_calls(lambda: ended.append(1), fail, lambda: (time.sleep(0.02), ended.append(3)))
    assert sorted(ended) == [1, 3]
    assert parallel_calls(lambda: 1, lambda: 2) == [1, 2]


def test_arrays_are_let_go(threads):
    out = np.zeros(100, np.int64)
    parallel_for(count, 100, out)
    gone = weakref.ref(out)
    del out
    end = time.monotonic() + 20
    while gone() is not None and time.monotonic() < end:  # a delayed thread still has to take its leave
        time.sleep(0.005)
        gc.collect()
    assert gone() is None


def _shared_in_a_fork(queue):
    out = np.zeros(100, np.int64)
    parallel_for(count, 100, out)
    queue.put(int(out.sum()))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(threads):
    parallel_for(count, 100, np.zeros(100, np.int64))
    fork = multiprocessing.get_context("fork")
    queue = fork.SimpleQueue()
    child = fork.Process(target=_shared_in_a_fork, args=(queue,))
    child.start()
    child.join(30)
    assert child.exitcode == 0 and queue.get() == 100
