"""diverged.npz: the state before an iteration with a non-finite loss or gradient, and a way to repeat it.

The file has the format of a checkpoint; its header names iteration, frame and term. No command reads it.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from endotsr.config import Config
from endotsr.training.fitting.divergence import Diverged
from endotsr.training.fitting.records import CheckpointHeader, LogEntry
from endotsr.training.runs.folder import RunFolder, open_run

if TYPE_CHECKING:
    from endotsr.training.fitting.state import TrainingState

NAME = "diverged.npz"


def save_diverged(folder: RunFolder, state: "TrainingState", error: Diverged, config: Config) -> Path:
    """Write the state before the diverged iteration; returns the file. Raises OSError."""
    from endotsr.training.fitting.checkpoint import save_checkpoint

    about = {"iteration": error.iteration, "frame": error.frame, "term": error.term}
    header: CheckpointHeader = {
        "config": msgspec.to_builtins(config),
        "lambda_lap": state.lambda_lap,
        "coarse": state.coarse,
        "diverged": about,
    }
    path = folder.path / NAME
    path.unlink(missing_ok=True)
    save_checkpoint(
        path, state.gaussians, state.adam, state.iteration, error.rng_state, state.statistics, header, state.frames
    )
    return path


def repeat_iteration(run: str | Path) -> LogEntry:
    """Repeat the diverged iteration of a run from its diverged.npz; this raises the same error again.

    run        run folder
    returns    the log entry, if the iteration now succeeds (on another machine, or with changed code)

    Raises: Diverged as in the run; InputError if there is no diverged.npz or it cannot be used.
    """
    from endotsr.training.fitting.checkpoint import load_checkpoint
    from endotsr.training.fitting.coarse_start import coarse_start
    from endotsr.training.fitting.state import state_from_checkpoint, training_constants
    from endotsr.training.fitting.trainer import training_step
    from endotsr.training.runs.sources import load_run_sequence

    folder = open_run(Path(run))
    config = folder.config()
    state = state_from_checkpoint(load_checkpoint(folder.path / NAME), config)
    sequence = load_run_sequence(folder)
    constants = coarse_start(sequence, config).constants if state.coarse else training_constants(sequence, config)
    return training_step(state, constants)
