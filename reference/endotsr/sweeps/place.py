"""Where runs take place: on the cores of this machine, or on the workers of a Dask scheduler."""

from collections.abc import Callable, Generator
from pathlib import Path
from typing import NamedTuple

from endotsr.errors import InputError
from endotsr.sequences.sequence import Sequence
from endotsr.sweeps.capacity import Size, capacity, run_bytes
from endotsr.sweeps.execute import Outcome
from endotsr.sweeps.jobs import Job


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
        raise InputError(f"{command}: --workers beside --scheduler is not allowed: the cluster has its workers")


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
