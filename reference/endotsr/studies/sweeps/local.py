"""The runs of a sweep on a pool of processes of this machine.

In: jobs. Out: outcomes as runs end, and None about once per second for the caller's progress display. A killed worker
ends its pool, and with it the runs beside it; a new pool continues all of them from their last checkpoints. A run that
was lost twice continues alone: its third loss is of its own process. A stopped sweep creates a file for which its
workers poll, because no signal stops another process gracefully on every system. Each worker finishes its iteration and
writes a checkpoint. Workers also stop in this way when their parent ends or is killed.
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

from endotsr.studies.sweeps.execute import FAILED, Outcome, execute
from endotsr.studies.sweeps.jobs import STOP, Job
from endotsr.untrusted.names import plain_line

TICK = 1.0  # seconds between two updates of the progress
MOST_LOSSES = 3  # of a run, by its own process or one beside it, after which it counts as failed
LOOK = 0.25  # seconds between two polls of a worker for the stop file
LAST_SECONDS = 20.0  # for workers to write their checkpoints
LOST = "its process was killed three times, the last time with no run beside it, perhaps for lack of memory"

_working = threading.Event()  # set in a worker while it executes a run


def local_outcomes(jobs: list[Job], workers: int, threads: int) -> Generator[Outcome | None, None, None]:
    """Execute the runs, `workers` at a time with `threads` threads each; KeyboardInterrupt stops all of them."""
    why = no_processes()
    if why:
        print(f"one run at a time in this process: {why}", flush=True)
        yield from _here(jobs, workers * threads)
        return
    waiting, losses = deque(jobs), Counter[str]()
    stop = Path(jobs[0].folder).parents[1] / STOP
    stop.unlink(missing_ok=True)
    while waiting:
        with _pool(workers, stop) as pool:
            yield from until_broken(pool, waiting, losses, workers, threads)


def no_processes() -> str:
    """Why this system cannot run a pool of processes, which needs semaphores; "" if it can."""
    try:
        multiprocessing.get_context("spawn").Lock()
    except (OSError, ImportError) as error:
        shared = "/dev/shm, " if os.name == "posix" else ""
        return f"semaphores cannot be created ({shared}{getattr(error, 'strerror', None) or error})"
    return ""


def _here(jobs: list[Job], threads: int) -> Generator[Outcome | None, None, None]:
    """Execute the runs in this process, one after the other. Raises KeyboardInterrupt once a signal has arrived."""
    from endotsr.training.runs.stopping import signals_stop, stop_asked

    for job in jobs:
        yield None
        with signals_stop():
            outcome = execute(job, threads)
            stopped = stop_asked()
        yield outcome
        if stopped:
            raise KeyboardInterrupt


def until_broken(
    pool: ProcessPoolExecutor, waiting: deque[Job], losses: Counter[str], workers: int, threads: int
) -> Generator[Outcome | None, None, None]:
    """Outcomes until all jobs are done or the pool loses a process; `waiting` then contains the jobs left."""
    running: dict[Future[Outcome], Job] = {}
    while waiting or running:
        try:
            while waiting and len(running) < _room([waiting[0], *running.values()], losses, workers):
                running[pool.submit(_work, waiting[0], threads)] = waiting[0]
                waiting.popleft()
        except BrokenProcessPool:
            pass  # the running futures raise it too
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


def _room(jobs: list[Job], losses: Counter[str], workers: int) -> int:
    """How many of these runs may be executed at once: one, if the next loss of any of them is its last."""
    return 1 if any(losses[job.name] == MOST_LOSSES - 1 for job in jobs) else workers


def _outcome(job: Job, future: Future[Outcome]) -> Outcome:
    error = future.exception()
    if error is None:
        return future.result()
    return Outcome(job.name, FAILED, plain_line(f"{type(error).__name__}: {error}"))


@contextlib.contextmanager
def _pool(workers: int, stop: Path) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes. An exception in the block stops the workers; the block's exit waits for them."""
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
    with contextlib.suppress(OSError):  # a full or missing disk: the workers are killed below
        stop.touch()
    ends = time.monotonic() + LAST_SECONDS
    for child in children:
        child.join(max(0.0, ends - time.monotonic()))
        if child.is_alive():
            child.kill()
    with contextlib.suppress(OSError):
        stop.unlink(missing_ok=True)


def _begin_worker(stop: Path) -> None:
    """Set up a worker: it ignores Ctrl-C in the terminal, and watches the stop file and its parent."""
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for systems without process groups; a run sets its own handler
    os.environ.setdefault("MPLBACKEND", "Agg")
    threading.Thread(target=_end_when_told, args=(stop,), daemon=True).start()


def _end_when_told(stop: Path) -> None:
    """In a worker: when the file appears or the parent ends, interrupt the run; an idle worker exits at once."""
    from endotsr.training.runs.stopping import stop_asked

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
    """In a worker: one run, interruptible between iterations."""
    from endotsr.training.runs.stopping import signals_stop, stop_asked

    with signals_stop():
        try:
            _working.set()
            return execute(job, threads)
        finally:
            _working.clear()
            if stop_asked():
                os._exit(0)  # the parent waits for this process to exit and ignores its outcome
