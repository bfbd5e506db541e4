"""The runs of a sweep on a pool of processes of this machine.

In: jobs. Out: their outcomes as they come, and None about once a second so that the caller can show progress. A worker
that was killed loses no run: its run is tried again, from the last checkpoint, by a new pool. A sweep that is stopped
creates a file, for which its workers look: no signal ends another process gently on every system. Each of them finishes
its iteration and writes a checkpoint. Workers end in the same way with their parent, also when it is killed.
"""

import _thread
import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection, process
from pathlib import Path

from endotsr.sweeps.execute import FAILED, Outcome, execute
from endotsr.sweeps.jobs import STOP, Job

TICK = 1.0  # seconds between two chances to show progress
MOST_LOSSES = 3  # processes that a run may lose before it counts as failed
LOOK = 0.25  # seconds between two looks of a worker for the file that ends it
LAST_SECONDS = 20.0  # in which workers write their checkpoints
LOST = "its process was ended from outside, three times; was it short of memory (fewer --workers need less)?"

_working = threading.Event()  # of a worker: it makes a run


def local_outcomes(jobs: list[Job], workers: int, threads: int) -> Generator[Outcome | None, None, None]:
    """Make the runs, `workers` at a time with `threads` threads each; after KeyboardInterrupt all of them stop."""
    waiting, losses = deque(jobs), Counter[str]()
    stop = Path(jobs[0].folder).parents[1] / STOP
    stop.unlink(missing_ok=True)
    while waiting:
        with _pool(workers, stop) as pool:
            yield from _until_broken(pool, waiting, losses, workers, threads)


def _until_broken(
    pool: ProcessPoolExecutor, waiting: deque[Job], losses: Counter[str], workers: int, threads: int
) -> Generator[Outcome | None, None, None]:
    """Outcomes until all jobs are done, or until the pool has lost a process; `waiting` then holds what is left."""
    running: dict[Future[Outcome], Job] = {}
    while waiting or running:
        try:
            while waiting and len(running) < workers:
                running[pool.submit(_work, waiting[0], threads)] = waiting[0]
                waiting.popleft()
        except BrokenProcessPool:
            pass  # the futures that are running say so too
        done = wait(running, TICK, FIRST_COMPLETED).done
        lost = [running[future] for future in done if isinstance(future.exception(), BrokenProcessPool)]
        for future in done:
            job = running.pop(future)
            if job not in lost:
                yield _outcome(job, future)
        if lost:
            lost += running.values()
            for job in reversed(lost):
                losses[job.name] += 1
                if losses[job.name] < MOST_LOSSES:
                    waiting.appendleft(job)
                else:
                    yield Outcome(job.name, FAILED, LOST)
            return
        yield None


def _outcome(job: Job, future: Future[Outcome]) -> Outcome:
    error = future.exception()
    return future.result() if error is None else Outcome(job.name, FAILED, f"{type(error).__name__}: {error}")


@contextlib.contextmanager
def _pool(workers: int, stop: Path) -> Iterator[ProcessPoolExecutor]:
    """A pool whose workers are told to stop, and waited for, if the block is left by an exception."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker, initargs=(stop,))
    try:
        yield pool
    except BaseException:
        children = set(multiprocessing.active_children()) - others
        _stop(children, stop)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _stop(children: set[process.BaseProcess], stop: Path) -> None:
    with contextlib.suppress(OSError):  # a disk that is full, or gone: the workers are killed below
        stop.touch()
    ends = time.monotonic() + LAST_SECONDS
    for child in children:
        child.join(max(0.0, ends - time.monotonic()))
        if child.is_alive():
            child.kill()
    with contextlib.suppress(OSError):
        stop.unlink(missing_ok=True)


def _begin_worker(stop: Path) -> None:
    """A worker leaves the Ctrl-C of a terminal to its parent, and looks for the end of it."""
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where there are no process groups; a run takes it itself
    os.environ.setdefault("MPLBACKEND", "Agg")
    threading.Thread(target=_end_when_told, args=(stop,), daemon=True).start()


def _end_when_told(stop: Path) -> None:
    """In a worker: when the file appears or the parent has ended, act as on Ctrl-C; an idle worker ends at once."""
    from endotsr.runs.stopping import stop_asked

    parent = multiprocessing.parent_process()
    assert parent is not None
    while not connection.wait([parent.sentinel], LOOK) and not stop.exists():
        pass
    if not _working.is_set():
        os._exit(0)
    if not stop_asked():  # a second signal would abandon the iteration
        _thread.interrupt_main()
    time.sleep(LAST_SECONDS)
    os._exit(1)


def _work(job: Job, threads: int) -> Outcome:
    """In a worker: one run, which is stopped after its iteration."""
    from endotsr.runs.stopping import signals_stop, stop_asked

    try:
        with signals_stop():
            _working.set()
            outcome = execute(job, threads)
    finally:
        _working.clear()
        if stop_asked():
            os._exit(0)  # the parent waits for the end of this process, and takes no other outcome
    return outcome
