"""diverged.npz: the state before an iteration whose loss or gradient was not finite, and the iteration once more.

The file has the form of a checkpoint; its header names iteration, frame and term. It is never read by a command.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from endotsr.config import Config
from endotsr.fitting.divergence import Diverged
from endotsr.fitting.records import CheckpointHeader, LogEntry
from endotsr.runs.folder import RunFolder, open_run

if TYPE_CHECKING:
    from endotsr.fitting.state import TrainingState
    from endotsr.sequences.sequence import Sequence

NAME = "diverged.npz"


def save_diverged(folder: RunFolder, state: "TrainingState", error: Diverged, config: Config) -> Path:
    """Write the state before the iteration that diverged; returns the file. Raises OSError."""
    from endotsr.fitting.checkpoint import save_checkpoint

    about = {"iteration": error.iteration, "frame": error.frame, "term": error.term}
    header: CheckpointHeader = {
        "config": msgspec.to_builtins(config),
        "lambda_lap": state.lambda_lap,
        "diverged": about,
    }
    path = folder.path / NAME
    path.unlink(missing_ok=True)
    save_checkpoint(
        path, state.gaussians, state.adam, state.iteration, error.rng_state, state.statistics, header, state.frames
    )
    return path


def repeat_iteration(run: str | Path, sequence: "Sequence | None" = None) -> LogEntry:
    """Repeat the iteration that stopped a run, from its diverged.npz: the same error is raised again.

    run        run folder
    sequence   the sequence of the run; default: it is read from its recorded place
    returns    the log entry, if the iteration now succeeds (on another machine, or with changed code)

    Raises: Diverged as in the run; InputError if there is no diverged.npz or it cannot be used.
    """
    from endotsr.fitting.checkpoint import load_checkpoint
    from endotsr.fitting.state import state_from_checkpoint, training_constants
    from endotsr.fitting.trainer import training_step
    from endotsr.runs.sources import load_run_sequence

    folder = open_run(Path(run))
    config = folder.config()
    state = state_from_checkpoint(load_checkpoint(folder.path / NAME), config)
    return training_step(state, training_constants(load_run_sequence(folder) if sequence is None else sequence, config))
