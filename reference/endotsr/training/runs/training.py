"""Training in a run folder: start, resume, log, save and stop without loss.

In: a sequence, settings, and an observer called at every iteration. Out: the run folder with log, checkpoints and
run.json. After a signal, the current iteration is completed and a checkpoint is written; the error message explains how
to continue. This module prints nothing itself but the line of a stop during the compilation.

A checkpoint is written at least every `training.checkpoint_every` iterations, and whenever `LARGEST_LOSS` of the
training time (between `FEWEST_SECONDS` and `MOST_SECONDS`) has passed since the last one. A kill therefore costs at
most about that part of the training. Of slow checkpoints, those due by time are written less often, to take at most
`LARGEST_FRACTION` of it. Results do not depend on when checkpoints are written.
"""

import contextlib
import shutil
import sys
import time
from typing import TYPE_CHECKING, Protocol

from endotsr.config import Config, config_to_toml, with_settings
from endotsr.errors import InputError
from endotsr.training.fitting.divergence import Diverged
from endotsr.training.fitting.records import LogEntry
from endotsr.training.runs.files import os_error_line
from endotsr.training.runs.folder import RunFolder, create_run, resume_command
from endotsr.training.runs.log import RunLog
from endotsr.training.runs.machine import now, peak_memory_bytes
from endotsr.training.runs.records import ExtendedEntry, ResumedEntry, RunRecord
from endotsr.training.runs.stopping import INTERRUPTED, finishing, leaving_at_once, stop_asked
from endotsr.untrusted.writing import replace_text

if TYPE_CHECKING:
    from pathlib import Path

    from endotsr.clips.sequences.sequence import Sequence
    from endotsr.training.fitting.state import TrainingState


FEWEST_SECONDS, MOST_SECONDS = 10.0, 300.0  # of training between two checkpoints
LARGEST_LOSS = 0.1  # fraction of the training time that a kill may cost
LARGEST_FRACTION = 0.02  # fraction of the time that checkpoints may take


class RunStopped(InputError):
    """A write failed during a run."""


class Observer(Protocol):
    """Callbacks of a training."""

    def begin(self, state: "TrainingState") -> None:
        """The training begins. It updates `state` in place; an observer must not change it."""

    def update(self, entry: LogEntry) -> None:
        """The log entry of one iteration."""

    def say(self, message: str) -> None:
        """One line of text for the user."""

    def close(self) -> None:
        """The training has ended."""


def train_new_run(
    out: "Path", record: RunRecord, sequence: "Sequence", config: Config, observer: Observer, options: str = ""
) -> RunFolder:
    """Create a run folder and train to the end; `options` and errors as in `train_run`.

    The folder is removed if a write fails before the first checkpoint.
    """
    from endotsr.clips.sequences.record import record_of
    from endotsr.training.fitting.state import new_training

    state = new_training(sequence, config)
    folder = create_run(out, config, record, record_of(sequence))
    try:
        with folder.locked():
            train_run(folder, state, sequence, config, observer, options)
    except RunStopped as stopped:
        if folder.has_checkpoint:
            raise
        shutil.rmtree(folder.path, ignore_errors=True)  # nothing of use was written
        raise InputError(str(stopped).split(";")[0]) from None
    return folder


def resume_run(folder: RunFolder, sequence: "Sequence", threads: int, observer: Observer, options: str = "") -> None:
    """Train a run from its last checkpoint to the end with the settings of its config.toml."""
    from endotsr.training.fitting.state import new_training
    from endotsr.training.runs.model import load_training

    config = folder.config()
    with folder.locked():
        for line in _without_leftovers(folder):
            observer.say(line)
        saved = folder.has_checkpoint
        state = load_training(folder, config, continues=True) if saved else new_training(sequence, config)
        planned = config.training.iterations
        observer.say(f"resuming {folder.path} after iteration {state.iteration} of {planned}")
        if state.iteration < planned:
            entry: ResumedEntry = {"after_iteration": state.iteration, "started": now(), "threads": threads}
            folder.update({"status": "running", "resumed": [*folder.record().get("resumed", []), entry]})
            train_run(folder, state, sequence, config, observer, options)
        elif folder.record().get("status") != "finished":  # stopped between the last checkpoint and this record
            folder.update({"status": "finished", "finished": now(), "iterations_done": state.iteration})


def _without_leftovers(folder: RunFolder) -> list[str]:
    """A sentence on the leftovers that are removed; none while another process evaluates the run and writes there."""
    with contextlib.suppress(InputError), folder.evaluating():
        return folder.remove_leftovers()
    return []


def extend_run(folder: RunFolder, iterations: int) -> None:
    """Set a larger number of iterations in config.toml and the checkpoint; no other setting changes.

    Milestones keep their iterations. Learning rates whose decay ends with the run follow the decay of the new length
    from the next iteration on: they jump up where their decay had begun.
    """
    from endotsr.training.runs.model import save_training

    with folder.locked():
        before = folder.config()
        config = with_settings(before, training={"iterations": iterations})
        if folder.has_checkpoint:
            save_training(folder, _state_to_extend(folder, before, config), config)
        replace_text(folder.path / "config.toml", config_to_toml(config))
        entry: ExtendedEntry = {"iterations": iterations, "before": before.training.iterations, "time": now()}
        folder.update({"extended": [*folder.record().get("extended", []), entry]})


def _state_to_extend(folder: RunFolder, before: Config, after: Config) -> "TrainingState":
    """The state of the latest checkpoint, also if an extension to the same length was stopped after writing it."""
    from endotsr.training.runs.model import load_training

    try:
        return load_training(folder, before, continues=True)
    except InputError as refused:
        try:
            return load_training(folder, after, continues=True)
        except InputError:
            raise refused from None


def train_run(
    folder: RunFolder,
    state: "TrainingState",
    sequence: "Sequence",
    config: Config,
    observer: Observer,
    options: str = "",
) -> "TrainingState":
    """Train from `state` to the end, with log, checkpoints and observer; returns the last state.

    options   of the evaluation that follows, for the line on how to continue

    A signal completes the current iteration and writes a checkpoint. After a second signal, or if the iteration takes
    too long, the last checkpoint remains.

    Raises:  KeyboardInterrupt or RunStopped (e.g. a full disk) with a line on how to continue; the last checkpoint and
             the log up to it are intact. FloatingPointError if the loss is not finite.
    """
    from endotsr.training.fitting.compile_ahead import compile_ahead
    from endotsr.training.fitting.trainer import train

    recorder = _Recorder(folder, state, config, observer, options)
    observer.begin(state)
    try:
        with finishing():
            with leaving_at_once(lambda: recorder.leave(state), INTERRUPTED):
                compile_ahead(config, observer.say)
            last = train(
                state, sequence, config, recorder.on_iteration, recorder.on_checkpoint, on_message=observer.say
            )
        recorder.finish(last)
    except (KeyboardInterrupt, Exception) as error:
        reason = recorder.stop(error, state)
        if reason is error:
            raise
        raise reason from None
    finally:
        observer.close()
        recorder.log.close()
    return last


def seconds_between(trained: float, saving: float) -> float:
    """Seconds of training between two checkpoints.

    trained   seconds since the training was started or resumed
    saving    seconds that the last checkpoint took
    """
    return max(min(max(LARGEST_LOSS * trained, FEWEST_SECONDS), MOST_SECONDS), saving / LARGEST_FRACTION)


class _Recorder:
    """Writes log, checkpoints and run.json of one training while it runs."""

    def __init__(
        self, folder: RunFolder, state: "TrainingState", config: Config, observer: Observer, options: str
    ) -> None:
        self.log = RunLog(folder.log, state.iteration)
        self._folder, self._config, self._observer, self._options = folder, config, observer, options
        self._seconds_before, self._began = self.log.seconds, time.monotonic()
        self._last_tick = self._saved_at = self._began
        self._state, self._saving_took = state, 0.0
        self._saved = state.iteration if folder.has_checkpoint else None
        self._between_iterations = False  # whether the run was stopped after a complete iteration

    def on_iteration(self, entry: LogEntry) -> None:
        """Log one iteration. Raises KeyboardInterrupt after a signal."""
        tick = time.monotonic()
        self.log.append({**entry, "seconds": round(tick - self._last_tick, 5)})
        self._last_tick = tick
        self._observer.update(entry)
        if stop_asked():
            self._between_iterations = True
            raise KeyboardInterrupt
        if tick - self._saved_at >= seconds_between(tick - self._began, self._saving_took):
            self.on_checkpoint(self._state)

    def on_checkpoint(self, state: "TrainingState") -> None:
        """Replace the checkpoint, unless it already is of this iteration."""
        from endotsr.training.runs.model import save_training

        if self._saved == state.iteration:
            return
        began = time.monotonic()
        save_training(self._folder, state, self._config)
        self._saved, self._saved_at = state.iteration, time.monotonic()
        self._saving_took = self._saved_at - began
        self._folder.update({"iterations_done": self._saved, "lambda_lap": state.lambda_lap, **self._costs()})

    def finish(self, last: "TrainingState") -> None:
        """Save the last state; mark the run as finished."""
        self.on_checkpoint(last)
        ended: RunRecord = {"status": "finished", "finished": now(), "iterations_done": last.iteration}
        self._folder.update({**ended, **self._costs()})

    def stop(self, error: BaseException, state: "TrainingState") -> BaseException:
        """Save the state if possible and mark the run; returns the error with advice on how to continue."""
        if isinstance(error, KeyboardInterrupt) or stop_asked():
            if self._between_iterations:
                with contextlib.suppress(OSError, KeyboardInterrupt):  # the previous checkpoint still exists
                    self._observer.say(f"stopping after iteration {state.iteration}, writing a checkpoint")
                    self.on_checkpoint(state)
            self._mark("interrupted")
            return KeyboardInterrupt(self._advice())
        if not self._folder.path.is_dir():
            return RunStopped(f"{self._folder.path}: the run folder was deleted; its training is lost")
        self._mark("failed")
        if isinstance(error, Diverged):
            return self._dumped(error, state)
        if isinstance(error, OSError):
            return RunStopped(f"{os_error_line(error, self._folder.path)}; {self._advice()}")
        return error

    def leave(self, state: "TrainingState") -> None:
        """Mark the run as interrupted, and say so, before the process ends during the compilation."""
        with contextlib.suppress(OSError):
            said = self.stop(KeyboardInterrupt(), state)
            print(f"\nendotsr: interrupted: {said}", file=sys.stderr, flush=True)

    def _dumped(self, error: Diverged, state: "TrainingState") -> BaseException:
        """The error, with the path of the saved state in its message."""
        from endotsr.training.runs.diverged import save_diverged

        with contextlib.suppress(OSError):
            kept = save_diverged(self._folder, state, error, self._config)
            error.args = (
                f"{error}; {kept} contains the state before it (`endotsr.training.runs.diverged.repeat_iteration`)",
            )
        return error

    def _advice(self) -> str:
        saved = self._saved
        kept = f"the checkpoint of iteration {saved} is kept" if saved else "no checkpoint yet; the run starts again"
        return f"{kept}; continue with `{resume_command(self._folder.path, self._options)}`"

    def _mark(self, status: str) -> None:
        with contextlib.suppress(OSError, InputError):  # fails too on a full disk
            self._folder.update({"status": status})

    def _costs(self) -> RunRecord:
        seconds = self._seconds_before + time.monotonic() - self._began
        return {"seconds": round(seconds, 2), "peak_memory_bytes": peak_memory_bytes()}
