"""Where runs execute: on this machine, as many as fit, or on the workers of a Dask scheduler.

Runs on this machine share its cores and memory without oversubscription.
"""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import NamedTuple

from endotsr.clips.sequences.forecast.cost import estimated_cost
from endotsr.clips.sequences.forecast.seconds import expected_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import Config, with_settings
from endotsr.errors import InputError
from endotsr.method.kernels.machine import memory_available, usable_cores
from endotsr.method.kernels.memory import ASSUMED
from endotsr.studies.sweeps.execute import Outcome
from endotsr.studies.sweeps.jobs import Job

MARGIN = 1.4  # factor on the memory estimate; measured peaks: 1.14 (`paper`) and 1.10 (`sharp`) times the estimate
USABLE = 0.9  # fraction of the free memory


class Size(NamedTuple):
    """The size of a sequence at its training scale."""

    frames: int
    width: int
    height: int


class Capacity(NamedTuple):
    """Number of concurrent runs, threads per run, and the reason as text."""

    workers: int
    threads: int
    reason: str


class Place(NamedTuple):
    """The user's options of a command."""

    workers: int | None  # None = as many as fit
    threads: int | None  # per run; None = the cores divided by the workers
    scheduler: str | None  # address; None = this machine


def check_place(command: str, place: Place) -> None:
    """Raises InputError for an invalid number of workers or threads, and for --workers with --scheduler."""
    for name in ("workers", "threads"):
        value = getattr(place, name)
        if value is not None and value < 1:
            raise InputError(f"{command}: --{name} {value} is not allowed; use an integer >= 1")
    if place.scheduler is not None and place.workers is not None:
        raise InputError(f"{command}: --workers with --scheduler is not allowed: the cluster has its own workers")


def outcomes_at(
    place: Place,
    jobs: list[Job],
    out: Path,
    size_of: Callable[[Job], Size],
    sequence_of: Callable[[Job], Sequence] | None = None,
    what: str = "runs",
) -> Generator[Outcome | None, None, None]:
    """Execute the runs; yields outcomes in any order, and None while there is none. Prints one line on the capacity.

    sequence_of   sequence of a job, to be sent to a cluster; None: each worker reads the sequence of its run
    """
    if place.scheduler is not None:
        from endotsr.studies.sweeps.cluster import cluster_outcomes

        return cluster_outcomes(place.scheduler, jobs, sequence_of, out, place.threads)
    from endotsr.studies.sweeps.local import local_outcomes

    memory = [run_bytes(size_of(job), job.config) for job in jobs]
    found = capacity(memory, workers=place.workers, threads=place.threads)
    many = f"{len(jobs)} {what}, {found.workers} at a time"
    print(f"{many}, threads of each: {found.threads} ({found.reason})", flush=True)
    return local_outcomes(jobs, found.workers, found.threads)


def run_bytes(size: Size, config: Config) -> float:
    """Estimated memory of one run, bytes."""
    read = with_settings(config, sequence={"scale": 1.0})
    return MARGIN * estimated_cost(expected_frames(size.frames, read), size.width, size.height, read).total_bytes


def capacity(
    memory: list[float],
    *,
    cores: int | None = None,
    free: float | None = None,
    workers: int | None = None,
    threads: int | None = None,
) -> Capacity:
    """Workers and threads for runs with these `run_bytes`; every worker is assumed to need the largest.

    cores, free       cores and free bytes; default: those available to this process
    workers, threads  requested; default: as many runs as fit, with the cores divided among them

    Two threads train less than twice as fast as one, so a sweep finishes sooner with many runs of few threads.
    """
    cores = cores or usable_cores()
    known = memory_available() if free is None else free
    free = ASSUMED if known is None else known
    needed = max(memory, default=0.0)
    by_memory = max(1, int(USABLE * free / needed)) if needed else cores
    by_cores = max(1, cores // threads) if threads else cores
    chosen = workers or max(1, min(len(memory), by_memory, by_cores))
    found = f"{free / 1e9:.1f} GB " + ("free" if known is not None else "assumed: free memory is unknown")
    reason = f"{cores} cores, {needed / 1e9:.1f} GB per run, {found}"
    return Capacity(chosen, threads or max(1, cores // chosen), reason)
