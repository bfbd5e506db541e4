"""Where runs take place: on the cores of this machine, as many as fit, or on the workers of a Dask scheduler.

No core and no memory of this machine is given out twice.
"""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import NamedTuple

from endotsr.config import Config, with_settings
from endotsr.errors import InputError
from endotsr.kernels.machine import memory_available, memory_of_machine, usable_cores
from endotsr.kernels.memory import ASSUMED
from endotsr.sequences.checks.cost import estimated_cost
from endotsr.sequences.sequence import Sequence
from endotsr.sweeps.execute import Outcome
from endotsr.sweeps.jobs import Job

MARGIN = 1.4  # over the estimate; peaks of 1.14 (`paper`) and 1.10 (`sharp`) times the estimate were measured
USABLE = 0.9  # of the memory that is free
CGROUP_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


class Size(NamedTuple):
    """The size of a sequence at the scale of its training, as far as memory depends on it."""

    frames: int
    width: int
    height: int


class Capacity(NamedTuple):
    """Runs at a time, threads of each, and what the number of runs follows from."""

    workers: int
    threads: int
    reason: str


class Place(NamedTuple):
    """What the options of a command ask for; None = as many as fit, and this machine."""

    workers: int | None
    threads: int | None
    scheduler: str | None


def check_place(command: str, place: Place) -> None:
    """Raises InputError for a number of workers or threads that is not allowed."""
    for name in ("workers", "threads"):
        value = getattr(place, name)
        if value is not None and value < 1:
            raise InputError(f"{command}: --{name} {value} is not allowed; allowed: an integer >= 1")
    if place.scheduler is not None and place.workers is not None:
        raise InputError(f"{command}: --workers with --scheduler is not allowed: the cluster has its workers")


def outcomes_at(
    place: Place,
    jobs: list[Job],
    out: Path,
    size_of: Callable[[Job], Size],
    sequence_of: Callable[[Job], Sequence] | None = None,
    what: str = "runs",
) -> Generator[Outcome | None, None, None]:
    """Make the runs; their outcomes come in any order, None when there is none. One line says how they are made.

    sequence_of   of a job, to be sent to a cluster; None: its workers read the sequence of their run
    """
    if place.scheduler is not None:
        from endotsr.sweeps.cluster import cluster_outcomes

        return cluster_outcomes(place.scheduler, jobs, sequence_of, out, place.threads)
    from endotsr.sweeps.local import local_outcomes

    memory = [run_bytes(size_of(job), job.config) for job in jobs]
    found = capacity(memory, workers=place.workers, threads=place.threads)
    many = f"{len(jobs)} {what}, {found.workers} at a time"
    print(f"{many}, threads of each: {found.threads} ({found.reason})", flush=True)
    return local_outcomes(jobs, found.workers, found.threads)


def run_bytes(size: Size, config: Config) -> float:
    """Estimated memory of one run with these settings."""
    read = with_settings(config, sequence={"scale": 1.0})
    return MARGIN * estimated_cost(size.frames, size.width, size.height, read).total_bytes


def capacity(
    memory: list[float],
    *,
    cores: int | None = None,
    free: float | None = None,
    workers: int | None = None,
    threads: int | None = None,
) -> Capacity:
    """Workers and threads for runs of this memory each, `run_bytes`; the largest sets that of every worker.

    cores, free       of the machine; default: those that this process may use
    workers, threads  asked for; default: as many runs as fit, with all cores divided among them

    A training on two threads is less than twice as fast as on one, so many runs with few threads finish a sweep sooner
    than few runs with many.
    """
    cores = cores or usable_cores()
    known = free_memory() if free is None else free
    free = ASSUMED if known is None else known
    needed = max(memory, default=0.0)
    by_memory = max(1, int(USABLE * free / needed)) if needed else cores
    by_cores = max(1, cores // threads) if threads else cores
    chosen = workers or max(1, min(len(memory), by_memory, by_cores))
    found = f"{free / 1e9:.1f} GB " + ("free" if known is not None else "assumed: the system does not say what is free")
    reason = f"{cores} cores, {needed / 1e9:.1f} GB a run, {found}"
    return Capacity(chosen, threads or max(1, cores // chosen), reason)


def free_memory() -> float | None:
    """Bytes that programs can still take, within the limit of a container; None where the system does not say."""
    found = [value for value in (memory_available(), _container_limit(), memory_of_machine()) if value is not None]
    return min(found, default=None)


def _container_limit() -> float | None:
    for name in CGROUP_LIMITS:
        try:
            return float(Path(name).read_text(encoding="ascii"))
        except (OSError, ValueError):  # no such file, or the word `max`
            continue
    return None
