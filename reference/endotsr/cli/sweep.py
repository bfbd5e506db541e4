"""`endotsr sweep`: many runs from one file, on this machine or on a Dask cluster."""

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.progress import StepBar
from endotsr.errors import InputError

if TYPE_CHECKING:
    from endotsr.sweeps.execute import Outcome
    from endotsr.sweeps.jobs import Job
    from endotsr.sweeps.spec import Spec
    from endotsr.sweeps.sweep import Inputs, Rows


@dataclass
class SweepOptions:
    """Make every run of SPEC.toml (sequences x splits x configurations x seeds) and a table of their results in DIR.

    After a kill, Ctrl-C or a full disk the same command continues: finished runs are kept, a run that was begun goes
    on from its checkpoint. A failed run is named in the table and made again with --retry. Exit code 1: a run failed.
    """

    spec: Annotated[Path, Option("SPEC.toml", positional=True)]
    """the runs"""
    out: Annotated[Path | None, Option("DIR")] = None
    """folder of the sweep (required)"""
    workers: Annotated[int | None, Option("N")] = None
    """runs at a time (default: as many as cores and free memory allow)"""
    threads: Annotated[int | None, Option("N")] = None
    """threads of each run (default: the cores divided by the runs)"""
    scheduler: Annotated[str | None, Option("ADDRESS")] = None
    """send the runs to the workers of this Dask scheduler, such as tcp://host:8786; DIR is on a disk that all see"""
    retry: bool = False
    """also make the runs again that failed before"""
    dry_run: bool = False
    """list the runs and end"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.sweeps.spec import read_spec

    options = parse(SweepOptions, words, "sweep")
    place = Place(options.workers, options.threads, options.scheduler)
    check_place("sweep", place)
    if options.out is None:
        raise InputError("sweep: --out DIR is missing: the folder of the sweep")
    spec = read_spec(options.spec)
    if options.dry_run:
        return _list(spec, options.out)
    return ended(run_spec(spec, options.out, place, options.retry), options.out)


@dataclass(frozen=True)
class Place:
    """Where the runs take place."""

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


def run_spec(spec: "Spec", out: Path, place: Place, retry: bool, on_rows=lambda rows: None) -> "Rows":
    """The rows of a sweep, made where `place` says, under one progress bar."""
    from endotsr.evaluation.lpips import load_lpips_weights
    from endotsr.sweeps.sweep import Inputs, run_sweep

    load_lpips_weights(spec.lpips)  # weights that cannot be used are refused before the first run
    with StepBar("iterations") as bar:

        def outcomes(jobs: list["Job"], inputs: "Inputs") -> Generator["Outcome | None", None, None]:
            if place.scheduler is not None:
                from endotsr.sweeps.cluster import cluster_outcomes

                return cluster_outcomes(place.scheduler, jobs, inputs.sequence, out, place.threads)
            return _local(jobs, inputs, place)

        inputs = Inputs(keep=place.scheduler is not None)
        return run_sweep(spec, out, outcomes, bar, inputs=inputs, retry=retry, on_rows=on_rows)


def _local(jobs: list["Job"], inputs: "Inputs", place: Place) -> Generator["Outcome | None", None, None]:
    from endotsr.sweeps.capacity import capacity, run_bytes
    from endotsr.sweeps.local import local_outcomes

    memory = [run_bytes(inputs.size(job), job.config) for job in jobs]
    found = capacity(memory, workers=place.workers, threads=place.threads)
    print(f"{len(jobs)} runs, {found.workers} at a time, threads of each: {found.threads} ({found.reason})", flush=True)
    return local_outcomes(jobs, found.workers, found.threads)


def ended(rows: "Rows", out: Path) -> int:
    """Print the table and what to do about failed runs; 0, or 1 if a run failed."""
    from endotsr.sweeps.execute import FAILED
    from endotsr.sweeps.results import FILES, results_markdown

    print(results_markdown(rows))
    print(f"table: {', '.join(str(out / name) for name in FILES)}")
    failed = [row for row in rows if row["status"] == FAILED]
    if failed:
        print(f"{len(failed)} failed; --retry makes them again")
    return 1 if failed else 0


def _list(spec: "Spec", out: Path) -> int:
    from endotsr.sweeps.sweep import Inputs, planned

    plan = planned(spec, out, Inputs(keep=False), retry=False)
    for job in plan.jobs:
        print(f"{plan.rows[job.name]['status']:<9} {job.config.training.iterations:>7} iterations  {job.name}")
    return 0
