"""One run of a sweep: started or continued, trained and evaluated.

In: a job, its sequence, a number of threads. Out: an `Outcome`, and the run folder with metrics.json. A finished folder
stays unchanged; an unfinished one continues from its last checkpoint. `execute` is therefore idempotent. It raises
nothing: a failure is an outcome with a one-line reason.
"""

import errno
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.studies.sweeps.jobs import Job, finished_folder, measured_at_the_end, refuse_other_settings
from endotsr.studies.sweeps.locks import file_lock, run_lock
from endotsr.studies.sweeps.spec import Start
from endotsr.training.fitting.records import LogEntry
from endotsr.training.runs.files import os_error_line
from endotsr.training.runs.folder import RunBusy, RunFolder, create_run, open_run
from endotsr.training.runs.machine import now
from endotsr.training.runs.training import Observer
from endotsr.untrusted.names import plain_line

if TYPE_CHECKING:
    from endotsr.training.fitting.state import TrainingState

FINISHED, FAILED, INTERRUPTED = "finished", "failed", "interrupted"
COMMAND = ["endotsr", "sweep"]
FULL_DISK = (errno.ENOSPC, errno.EDQUOT)


class Outcome(NamedTuple):
    """The result of executing a job."""

    name: str  # of the job
    status: str  # finished, failed or interrupted
    reason: str = ""  # of a failure, one line
    ends_sweep: bool = False  # no other run can succeed, e.g. on a full disk


class Silent(Observer):
    """An observer without output; it stops the run when `stop` returns True."""

    def __init__(self, stop: Callable[[], bool] = lambda: False) -> None:
        self._stop = stop

    def update(self, entry: LogEntry) -> None:
        """Raises KeyboardInterrupt to stop the run."""
        if self._stop():
            raise KeyboardInterrupt


def execute(
    job: Job, threads: int, sequence: Sequence | None = None, stop: Callable[[], bool] | None = None
) -> Outcome:
    """Execute a run, or its missing part.

    threads   of compiled kernels; results do not depend on them
    sequence  of the job; None = read it
    stop      called after every iteration; True stops the run
    """
    from endotsr.method.kernels.threads import use_threads

    try:
        if finished_folder(job) is None:
            use_threads(threads)
            loaded = loaded_sequence(job) if sequence is None else sequence
            folder = _trained(job, loaded, threads, Silent(stop or (lambda: False)))
            with run_lock(folder):
                _measured(job, folder, loaded)
    except KeyboardInterrupt:
        return Outcome(job.name, INTERRUPTED)
    except MemoryError:
        return Outcome(job.name, FAILED, "not enough memory; fewer --workers need less")
    except Exception as error:
        return Outcome(job.name, FAILED, _reason(error), ends_sweep=_full_disk(error))
    return Outcome(job.name, FINISHED)


def loaded_sequence(job: Job) -> Sequence:
    """The sequence of a job, read and checked. Raises InputError."""
    from endotsr.training.runs.sources import load_sequence

    return load_sequence(job.source, job.config, job.simulator)


def _trained(job: Job, sequence: Sequence, threads: int, observer: Silent) -> RunFolder:
    """The folder of the job, trained to the end."""
    from endotsr.training.runs.sources import check_same_input
    from endotsr.training.runs.training import resume_run

    path = Path(job.folder)
    if not path.exists():
        try:
            return _begun(job, sequence, threads, observer)
        except InputError:
            if not path.exists():
                raise  # otherwise another process has begun the run in the meantime
    folder = open_run(path)
    refuse_other_settings(job, folder)
    check_same_input(folder, sequence, job.source)
    with run_lock(folder):
        abandoned = job.start is not None and not folder.has_checkpoint  # its first state was not written
    if abandoned:
        shutil.rmtree(path)
        return _begun(job, sequence, threads, observer)
    while True:
        try:
            resume_run(folder, sequence, threads, observer)
            return folder
        except RunBusy:
            with run_lock(folder):
                pass


def _begun(job: Job, sequence: Sequence, threads: int, observer: Silent) -> RunFolder:
    """A new run, trained to the end."""
    from endotsr.clips.sequences.record import record_of
    from endotsr.training.runs.model import save_training
    from endotsr.training.runs.sources import start_record
    from endotsr.training.runs.training import train_new_run, train_run

    record = start_record([*COMMAND, job.name], job.source, sequence, job.config, job.simulator, threads)
    if job.start is None:
        return train_new_run(Path(job.folder), record, sequence, job.config, observer)
    if isinstance(job.start, Start):
        record["start"] = {"configuration": job.start.configuration, "iteration": job.start.iteration}
        state = _start_state(job, sequence)
    else:
        record["start"], state = job.start.about(), job.start.state(sequence, job.config)
    folder = create_run(Path(job.folder), job.config, record, record_of(sequence))
    with folder.locked():
        save_training(folder, state, job.config)
        train_run(folder, state, sequence, job.config, observer)
    return folder


def _start_state(job: Job, sequence: Sequence) -> "TrainingState":
    """The shared initial state. The first run that needs it trains it; the others wait."""
    from endotsr.training.fitting.checkpoint import load_checkpoint
    from endotsr.training.fitting.state import state_from_checkpoint

    path = job.shared_checkpoint
    path.parent.mkdir(parents=True, exist_ok=True)
    with file_lock(path.with_suffix(".lock"), wait=True):
        if not path.exists():
            _train_start(job, sequence, path)
    return state_from_checkpoint(load_checkpoint(path), job.config)


def _train_start(job: Job, sequence: Sequence, path: Path) -> None:
    """Train the other configuration, with its own schedule, to the iteration at which this run begins."""
    from endotsr.training.fitting.compile_ahead import compile_ahead
    from endotsr.training.fitting.state import new_training, save_state, training_constants
    from endotsr.training.fitting.trainer import training_step
    from endotsr.training.runs.stopping import stop_asked

    assert isinstance(job.start, Start)
    config = job.start.config
    compile_ahead(config, lambda line: None)
    constants, state = training_constants(sequence, config), new_training(sequence, config)
    while state.iteration < job.start.iteration:
        training_step(state, constants)
        if stop_asked():
            raise KeyboardInterrupt
    save_state(path, state, config)


def _measured(job: Job, folder: RunFolder, sequence: Sequence) -> None:
    """Write metrics.json, pictures and report of a trained run; remove checkpoints that are not to be kept."""
    from endotsr.results.evaluation.lpips import load_lpips_weights
    from endotsr.results.evaluation.run import measure_folder
    from endotsr.results.report.run_files import write_evaluation
    from endotsr.training.runs.model import load_model

    if folder.record().get("status") != FINISHED:  # killed between the last checkpoint and this record
        folder.update({"status": FINISHED, "finished": now()})
    if not job.measured or measured_at_the_end(job):
        return
    weights = load_lpips_weights(job.lpips)
    with folder.evaluating(wait=True):
        model = load_model(folder)
        metrics, held_out = measure_folder(folder, model, sequence, job.source, weights=weights, measures=job.measures)
        write_evaluation(folder, sequence, metrics, held_out)
    folder.previous.unlink(missing_ok=True)
    if not job.keep_checkpoints:
        folder.checkpoint.unlink(missing_ok=True)


def _reason(error: Exception) -> str:
    """The reason of a failure in one line."""
    if isinstance(error, OSError):
        return plain_line(os_error_line(error))
    named = isinstance(error, InputError | FloatingPointError)
    return plain_line(str(error) if named else f"{type(error).__name__}: {error}")


def _full_disk(error: BaseException | None) -> bool:
    """Whether a full disk caused an error."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in FULL_DISK:
            return True
        error = error.__cause__ or error.__context__
    return False
