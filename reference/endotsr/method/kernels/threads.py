"""Threads for serial kernels: `parallel_for` distributes the rows (or blocks, or Gaussians) of a kernel.

A kernel `kernel(first, stop, *arguments)` handles the tasks first ... stop - 1. It is compiled once, as a plain loop
that releases the interpreter lock. Python threads call it for ranges of tasks. No two tasks write to the same cell, so
results are bitwise independent of the number of threads and of the ranges.

Numba's `parallel=True` is not used. It compiles the body of a loop several times, which makes a cold start longer, and
its regions take longer to start. Its static split makes every thread wait for the slowest one when the machine has
other work.
"""

import os
import threading
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from typing import Any, NamedTuple

import numba

from endotsr.errors import InputError
from endotsr.method.kernels.machine import usable_cores

RANGES_PER_THREAD = 16  # the shortest range is tasks / (threads RANGES_PER_THREAD), which limits their number


class _Job(NamedTuple):
    """Ranges for any thread; every finished range puts one entry into `done`."""

    kernel: Callable[..., Any]
    arguments: tuple[Any, ...]
    ranges: Iterator[tuple[int, int]]  # of a list: `next` is atomic
    done: SimpleQueue  # None, or the exception of a range


_jobs: SimpleQueue = SimpleQueue()
_workers: list[threading.Thread] = []
_hiring = threading.Lock()


def parallel_for(kernel: Callable[..., Any], tasks: int, *arguments: Any) -> None:
    """Call kernel(first, stop, *arguments) for ranges that cover 0 ... tasks - 1, on several threads.

    kernel   compiled by `jit`; no two tasks may write to the same cell. A plain function runs in this thread alone
    The number of threads is `numba.get_num_threads()`, this one included.
    Edges:   without tasks nothing is called. The first call of a kernel compiles it in this thread.
    Raises:  the kernel's exception, after all ranges have ended.
    """
    threads = min(numba.get_num_threads(), tasks)
    if threads <= 1 or not getattr(kernel, "overloads", None):
        if tasks > 0:
            kernel(0, tasks, *arguments)
        return
    _distribute(kernel, arguments, ranges(tasks, threads), threads)


def parallel_calls(*calls: Callable[[], Any]) -> list[Any]:
    """Results of independent calls, in order; the calls run concurrently.

    For the work between kernels: an idle thread starts the next call, or joins the `parallel_for` of a running call.
    With one thread, or with the JIT off (Python code holds the interpreter lock), the calls run in sequence.
    Raises:  the exception of a call, after all have ended.
    """
    alone = numba.config.DISABLE_JIT  # type: ignore[attr-defined]
    threads, results = 1 if alone else numba.get_num_threads(), [None] * len(calls)

    def make(first: int, stop: int) -> None:
        if not alone:
            numba.set_num_threads(threads)  # the setting belongs to a thread
        for k in range(first, stop):
            results[k] = calls[k]()

    _distribute(make, (), [(k, k + 1) for k in range(len(calls))], threads)
    return results


def use_threads(asked: int) -> int:
    """Set the number of threads of compiled kernels (0 = all cores) and return it. No result depends on it.

    A number above Numba's thread count (one per core) selects all threads. Raises InputError below 0.
    """
    if asked < 0:
        raise InputError(f"--threads {asked} is not allowed; use 0 (all cores) or more")

    most = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    used = min(asked or usable_cores(), most)
    numba.set_num_threads(used)
    return used


def _distribute(
    kernel: Callable[..., Any], arguments: tuple[Any, ...], pieces: list[tuple[int, int]], threads: int
) -> None:
    """Run all ranges on the threads, this one included, and wait for them."""
    _hire(threads - 1)
    job = _Job(kernel, arguments, iter(pieces), SimpleQueue())
    for _ in range(threads - 1):
        _jobs.put(job)
    _work(job)
    errors = [error for error in [job.done.get() for _ in pieces] if error is not None]
    if errors:
        raise errors[0]


def ranges(tasks: int, threads: int) -> list[tuple[int, int]]:
    """Ranges that cover 0 ... tasks - 1. Each is half of a thread's share of the rest, so the last ones are short."""
    smallest = -(-tasks // (threads * RANGES_PER_THREAD))
    found, first = [], 0
    while first < tasks:
        stop = min(tasks, first + max(smallest, (tasks - first) // (2 * threads)))
        found.append((first, stop))
        first = stop
    return found


def _work(job: _Job) -> None:
    for first, stop in job.ranges:
        try:
            job.kernel(first, stop, *job.arguments)
            job.done.put(None)
        except BaseException as error:  # the calling thread raises it
            job.done.put(error)


def _serve(jobs: SimpleQueue) -> None:
    while True:
        _work(jobs.get())  # no local name: it would keep the last arrays alive in a waiting thread


def _hire(count: int) -> None:
    with _hiring:
        while len(_workers) < count:
            worker = threading.Thread(target=_serve, args=(_jobs,), name="endotsr-kernel", daemon=True)
            worker.start()
            _workers.append(worker)


def _forget_workers() -> None:
    """Forget the parent's threads in a forked process, where they do not exist."""
    global _jobs, _hiring
    _jobs, _hiring = SimpleQueue(), threading.Lock()
    _workers.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_workers)
