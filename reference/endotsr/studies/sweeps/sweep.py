"""A sweep from its spec to its table: finished runs are kept, the others are executed, and every result is saved.

In: a checked spec, the folder of the sweep, and a function from jobs to outcomes that executes the runs on this machine
or on a cluster. Out: the rows of the table in the order of the spec.

    DIR/runs/NAME/     one run folder per run        DIR/results.json, .csv, .md   the table, updated after each run
    DIR/shared/        shared initial checkpoints    DIR/sweep.lock
"""

import contextlib
import shlex
from collections import Counter
from collections.abc import Callable, Generator
from pathlib import Path
from typing import NamedTuple, Protocol

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.studies.sweeps.execute import FAILED, FINISHED, Outcome, loaded_sequence
from endotsr.studies.sweeps.jobs import RUNS, Job, finished_folder, jobs_of, refuse_other_clip
from endotsr.studies.sweeps.locks import file_lock
from endotsr.studies.sweeps.place import Size
from endotsr.studies.sweeps.results import FILES, RunRow, failures, finished_row, open_row, write_results
from endotsr.studies.sweeps.spec import Spec
from endotsr.training.runs.files import refuse_folder
from endotsr.training.runs.folder import RunFolder
from endotsr.training.runs.log import last_iteration
from endotsr.untrusted.marks import refuse_foreign

LOCK = "sweep.lock"
Rows = list[RunRow]


class Reporter(Protocol):
    """Callbacks for the progress of a sweep."""

    def begin(self, steps: int) -> None:
        """The sweep begins; `steps` iterations are left in all runs."""

    def step(self, count: int = 1) -> None:
        """`count` iterations were completed."""

    def say(self, message: str) -> None:
        """One line of text for the user."""


class Inputs:
    """The sequences of a sweep, each read and checked once before any run."""

    def __init__(self, keep: bool) -> None:
        self._keep = keep  # keep the sequences in memory, to send them to a cluster
        self._sizes: dict[str, tuple[int, Size]] = {}
        self._sequences: dict[str, Sequence] = {}

    def training_frames(self, job: Job) -> int:
        """Number of training frames of a job's sequence. Raises InputError for an unusable sequence."""
        return self._of(job)[0]

    def size(self, job: Job) -> Size:
        """Size of a job's sequence."""
        return self._of(job)[1]

    def sequence(self, job: Job) -> Sequence:
        """The sequence of a job."""
        self._of(job)
        return self._sequences[job.input_key]

    def _of(self, job: Job) -> tuple[int, Size]:
        if job.input_key not in self._sizes:
            sequence = loaded_sequence(job)
            size = Size(sequence.count, sequence.width, sequence.height)
            self._sizes[job.input_key] = len(sequence.train_index), size
            if self._keep:
                self._sequences[job.input_key] = sequence
        return self._sizes[job.input_key]


# Executes jobs; yields outcomes in any order, and None while there is none.
Outcomes = Callable[[list[Job]], Generator[Outcome | None, None, None]]


class SweepPlan(NamedTuple):
    """The runs of a sweep and their state."""

    jobs: list[Job]
    rows: dict[str, RunRow]  # by name of the run
    left: list[Job]
    failed: dict[str, str]  # name -> reason of earlier failures that are not retried


def planned(spec: Spec, out: Path, inputs: Inputs, retry: bool) -> SweepPlan:
    """Every run and its state.

    retry    execute failed runs again
    Raises:  InputError for an unusable sequence or folder, and for finished runs of other frames.
    """
    jobs, before = jobs_of(spec, out, inputs.training_frames), failures(out)
    rows = {job.name: finished_row(job) if finished_folder(job) else open_row(job) for job in jobs}
    refuse_other_clip([job for job in jobs if rows[job.name]["status"] == FINISHED])
    failed = (
        {} if retry else {name: before[name] for name in rows if name in before and rows[name]["status"] != FINISHED}
    )
    for job in jobs:
        if job.name in failed:
            rows[job.name] = open_row(job, Outcome(job.name, FAILED, failed[job.name]))
    left = [job for job in jobs if rows[job.name]["status"] != FINISHED and job.name not in failed]
    return SweepPlan(jobs, rows, left, failed)


def run_sweep(
    spec: Spec,
    out: Path,
    outcomes: Outcomes,
    reporter: Reporter,
    *,
    inputs: Inputs,
    retry: bool = False,
    on_rows: Callable[[Rows], None] = lambda rows: None,
) -> Rows:
    """Execute every unfinished run; write the table before the first run and after each run.

    outcomes   executes the remaining jobs
    retry      execute failed runs again
    on_rows    called with the rows whenever the table is written
    Raises:    InputError for unusable input, for a sweep that is already running, and for a full disk;
               KeyboardInterrupt with a line on how to continue.
    """
    out = Path(out)
    refuse_folder(out)
    for name in FILES:
        refuse_foreign(out / name, beside=out / RUNS)
    if not out.exists():
        planned(spec, out, inputs, retry)  # a sequence that is refused leaves no folder
    (out / RUNS).mkdir(parents=True, exist_ok=True)
    with file_lock(out / LOCK, f"{out}: another process runs this sweep; wait until it ends, or stop it"):
        plan = planned(spec, out, inputs, retry)
        rows, watch = plan.rows, Watch(plan.left)
        reporter.begin(watch.total)
        write_results(out, list(rows.values()))
        on_rows(list(rows.values()))
        for name, reason in plan.failed.items():
            reporter.say(f"failed before: {name}: {reason}")
        for line in lacking(plan):
            reporter.say(line)
        jobs = {job.name: job for job in plan.left}
        advice = lambda: f"{_count(rows)} runs are finished; the same command continues"
        try:
            with contextlib.closing(as_they_end(plan.left, outcomes, reporter, watch, advice)) as made:
                for outcome in made:
                    job = jobs[outcome.name]
                    rows[job.name] = finished_row(job) if outcome.status == FINISHED else open_row(job, outcome)
                    write_results(out, list(rows.values()))
                    on_rows(list(rows.values()))
                    reporter.say(_line(rows, job))
        except KeyboardInterrupt:
            raise KeyboardInterrupt(advice()) from None
        return list(rows.values())


def lacking(plan: SweepPlan) -> list[str]:
    """Measurements that finished runs are without, as after a change of `measures` or `lpips`, and how to add them."""
    without = [(job, names) for job in plan.jobs if (names := _without(job, plan.rows[job.name]))]
    if not without:
        return []
    counts = Counter(name for _, names in without for name in names)
    lines = [
        f"{name}: {count} of the finished runs are without it; a finished run is not measured again"
        for name, count in counts.items()
    ]
    kept = next((job for job, _ in without if RunFolder(Path(job.folder)).has_checkpoint), None)
    if kept is None:
        return [*lines, "their checkpoints are not kept: delete the folders of these runs, or choose another --out"]
    return [*lines, f"to add them, for each of these runs: {_measuring(kept)}; then the same command updates the table"]


def _without(job: Job, row: RunRow) -> list[str]:
    """The measurements of a job that its finished run is without."""
    if row["status"] != FINISHED:
        return []
    found = [name for name in job.measures if name not in row.get("measures", {})]
    return found + ["lpips"] * (job.lpips is not None and row.get("lpips") is None)


def _measuring(job: Job) -> str:
    """The command that measures a finished run again, with everything that its job names."""
    words = ["endotsr", "evaluate", job.folder, *(["--measures", *job.measures] if job.measures else [])]
    return shlex.join([*words, *(["--lpips", job.lpips] if job.lpips is not None else [])])


def as_they_end(
    jobs: list[Job], outcomes: Outcomes, reporter: Reporter, watch: "Watch", advice: Callable[[], str]
) -> Generator[Outcome, None, None]:
    """Outcomes as runs end, with progress reports. Closing the generator stops the remaining runs.

    Raises: InputError with `advice` for an outcome that ends the sweep.
    """
    if not jobs:
        return
    with contextlib.closing(outcomes(jobs)) as found:
        for outcome in found:
            reporter.step(watch.progress())
            if outcome is None:
                continue
            if outcome.ends_sweep:
                raise InputError(f"{outcome.reason}; {advice()}")
            yield outcome
    reporter.step(watch.progress())


class Watch:
    """The progress of runs in iterations, read from the ends of their logs."""

    def __init__(self, jobs: list[Job]) -> None:
        self._logs = {job.name: Path(job.folder) / "log.jsonl" for job in jobs}
        self._seen = {name: last_iteration(log) for name, log in self._logs.items()}
        self.total = sum(job.config.training.iterations - self._seen[job.name] for job in jobs)

    def progress(self) -> int:
        """Iterations since the last call; iterations repeated after a checkpoint count again."""
        found = {name: last_iteration(log) for name, log in self._logs.items()}
        steps = sum(found[name] - seen for name, seen in self._seen.items())
        self._seen = found
        return max(steps, 0)


def _line(rows: dict[str, RunRow], job: Job) -> str:
    row = rows[job.name]
    if row["status"] != FINISHED:
        return f"{row['status']}: {job.name}" + (f": {row['reason']}" if "reason" in row else "")
    value = row.get("psnr_tissue")
    shown = "-" if value is None else f"{value:.2f}"
    return f"{_count(rows)}: {job.name}: PSNR tissue {shown} dB, {row.get('gaussians')} Gaussians"


def _count(rows: dict[str, RunRow]) -> str:
    return f"{sum(row['status'] == FINISHED for row in rows.values())} of {len(rows)}"
