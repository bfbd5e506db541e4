"""`endotsr sweep`: many runs from one file, on this machine or on a Dask cluster."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.progress import StepBar

if TYPE_CHECKING:
    from endotsr.studies.sweeps.place import Place
    from endotsr.studies.sweeps.spec import Spec
    from endotsr.studies.sweeps.sweep import Rows


@dataclass
class SweepOptions:
    """Execute every run of SPEC.toml (sequences x splits x configurations x seeds), with a table of results in DIR.

    After a kill, Ctrl-C or a full disk, the same command continues: finished runs are kept, and unfinished runs
    continue from their checkpoints. The table lists failed runs; --retry repeats them. Exit code 1: a run failed.
    """

    spec: Annotated[Path, Option("SPEC.toml", positional=True)]
    """specification of the runs"""
    out: Annotated[Path, Option("DIR")]
    """folder of the sweep"""
    workers: Annotated[int | None, Option("N")] = None
    """concurrent runs (default: as many as cores and free memory allow)"""
    threads: Annotated[int | None, Option("N")] = None
    """threads per run (default: the cores divided by the runs)"""
    scheduler: Annotated[str | None, Option("ADDRESS")] = None
    """send the runs to the workers of this Dask scheduler, such as tcp://host:8786; DIR must be on a shared disk"""
    retry: bool = False
    """repeat failed runs"""
    dry_run: bool = False
    """list the runs without executing them"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.studies.sweeps.place import Place, check_place
    from endotsr.studies.sweeps.spec import read_spec

    options = parse(SweepOptions, words, "sweep")
    place = Place(options.workers, options.threads, options.scheduler)
    check_place("sweep", place)
    spec = read_spec(options.spec)
    if options.dry_run:
        return _list(spec, options.out, options.retry)
    return ended(run_spec(spec, options.out, place, options.retry), options.out)


def run_spec(spec: "Spec", out: Path, place: "Place", retry: bool, on_rows=lambda rows: None) -> "Rows":
    """Execute a sweep at `place` with a progress bar; returns its rows."""
    from endotsr.results.evaluation.lpips import load_lpips_weights
    from endotsr.studies.sweeps.place import outcomes_at
    from endotsr.studies.sweeps.sweep import Inputs, run_sweep

    load_lpips_weights(spec.lpips)  # raises for unusable weights before the first run
    print(f"reading {', '.join(spec.sequences)}", flush=True)
    inputs = Inputs(keep=place.scheduler is not None)
    outcomes = lambda jobs: outcomes_at(place, jobs, out, inputs.size, inputs.sequence)
    with StepBar("iterations") as bar:
        return run_sweep(spec, out, outcomes, bar, inputs=inputs, retry=retry, on_rows=on_rows)


def ended(rows: "Rows", out: Path) -> int:
    """Print the table and advice on failed runs; returns 0, or 1 if a run failed."""
    from endotsr.studies.sweeps.execute import FAILED
    from endotsr.studies.sweeps.results import FILES, results_markdown

    print(results_markdown(rows))
    print(f"table: {', '.join(str(out / name) for name in FILES)}")
    failed = [row for row in rows if row["status"] == FAILED]
    if failed:
        print(f"{len(failed)} failed; --retry repeats them")
    return 1 if failed else 0


def _list(spec: "Spec", out: Path, retry: bool) -> int:
    from endotsr.studies.sweeps.sweep import Inputs, lacking, planned

    plan = planned(spec, out, Inputs(keep=False), retry)
    for job in plan.jobs:
        print(f"{plan.rows[job.name]['status']:<9} {job.config.training.iterations:>7} iterations  {job.name}")
    for line in lacking(plan):
        print(line)
    return 0
