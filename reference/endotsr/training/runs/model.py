"""From a run folder to a model for rendering, or to a training state.

A checkpoint is read with the settings of config.toml. If they belong to different runs (an edited file, a copied
checkpoint), the arrays would be misread. Therefore every setting is compared first, and the sequence's fingerprint with
run.json.
"""

import hashlib
import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.training.runs.files import warn
from endotsr.training.runs.folder import RunFolder, resume_command
from endotsr.training.runs.records import RunRecord
from endotsr.untrusted.toml import by_key

if TYPE_CHECKING:
    from endotsr.training.fitting.checkpoint import Checkpoint
    from endotsr.training.fitting.state import TrainingState
    from endotsr.training.scene.gaussians import Gaussians
    from endotsr.training.scene.parameters import FrameParameters

CHANGE_NO_NUMBER = {  # settings that may differ from the checkpoint's: they do not affect results
    "preset",
    "training.threads",
    "training.checkpoint_every",
    "training.visits_per_frame",
}


class Model(NamedTuple):
    """A trained model, ready to render."""

    gaussians: "Gaussians"
    spectral: Any  # frequencies, atom statistics and penalty weights of the training time stamps
    config: Config
    iteration: int
    frames: "FrameParameters | None" = None  # parameters of the training frames; None if the model has none


def load_model(folder: RunFolder) -> Model:
    """The model of the latest checkpoint. Raises InputError if it is missing, damaged, or has other settings."""
    from endotsr.training.fitting.model import spectral_from

    if not folder.has_checkpoint:
        raise InputError(f"{folder.path}: no checkpoint yet; continue the run with `{resume_command(folder.path)}`")
    config, record = folder.config(), folder.sequence_record()
    checkpoint, _ = _checkpoint_of(folder, config)
    spectral = spectral_from(config.model, record.train_times)
    return Model(checkpoint.gaussians, spectral, config, checkpoint.iteration, checkpoint.frames)


def save_training(folder: RunFolder, state: "TrainingState", config: Config) -> None:
    """Replace the last checkpoint by a training state, with the fingerprint of the sequence in run.json."""
    from endotsr.training.fitting.state import save_state

    save_state(folder.checkpoint, state, config, sequence_fingerprint(folder.record()))


def load_training(folder: RunFolder, config: Config, *, continues: bool = False) -> Any:
    """The training state of the latest intact checkpoint. Raises InputError if it is missing or has other settings.

    continues   the caller holds the lock and will write checkpoints: a damaged latest one is renamed to
                checkpoint.damaged.npz, so it never replaces the previous one
    """
    from endotsr.training.fitting.state import state_from_checkpoint

    checkpoint, damaged = _checkpoint_of(folder, config)
    try:
        state = state_from_checkpoint(checkpoint, config)
    except InputError as error:
        raise InputError(f"{folder.checkpoint}: {error}") from None
    if damaged and continues:
        folder.checkpoint.replace(folder.path / "checkpoint.damaged.npz")
    return state


def _checkpoint_of(folder: RunFolder, config: Config) -> tuple["Checkpoint", bool]:
    """The latest intact checkpoint, and whether a later one is damaged (with a warning).

    Raises: InputError if its settings or its sequence differ from those of the folder.
    """
    from endotsr.training.fitting.checkpoint import load_latest

    checkpoint, note = load_latest(folder.checkpoint)
    if note:
        warn(note)
    trained_on, recorded = checkpoint.header.get("sequence"), sequence_fingerprint(folder.record())
    if trained_on is not None and recorded is not None and trained_on != recorded:
        raise InputError(
            f"{folder.checkpoint}: trained on another sequence than the one in {folder.path / 'run.json'}; "
            "use unchanged checkpoint and records of one run"
        )
    asked = by_key(msgspec.json.decode(msgspec.json.encode(config)))  # as JSON, like the checkpoint's header
    for key, value in (*by_key(checkpoint.header.get("config")).items(), *_seen_in_arrays(checkpoint, config)):
        if key in asked and key not in CHANGE_NO_NUMBER and asked[key] != value:
            raise InputError(
                f"{folder.checkpoint}: trained with {key} = {value!r}, but {folder.path / 'config.toml'} has "
                f"{asked[key]!r}; use unchanged checkpoint and settings of one run"
            )
    return checkpoint, bool(note)


def sequence_fingerprint(record: RunRecord) -> str | None:
    """SHA-256 over the hashes of pictures, times and cameras in run.json; None without hashes."""
    hashes = record.get("input", {}).get("arrays_sha256")
    return hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest() if hashes else None


def _seen_in_arrays(checkpoint: "Checkpoint", config: Config) -> Iterator[tuple[str, Any]]:
    """The settings implied by the arrays themselves: (key, value)."""
    from endotsr.training.fitting.schedules import residuals_active
    from endotsr.training.scene.parameters import trained

    gaussians, active = checkpoint.gaussians, residuals_active(checkpoint.iteration, config)
    yield "training.precision", gaussians.position.dtype.name
    yield "model.harmonics_degree", math.isqrt(len(gaussians.harmonics)) - 1
    yield "model.deformation", gaussians.fdm_weight is not None
    frames = trained(checkpoint.frames)
    yield "model.exposure", "exposure_log_gain" in frames
    yield "model.pose_correction", "pose_rotation" in frames
    if gaussians.fdm_weight is not None:
        yield "model.bases", gaussians.fdm_weight.shape[1]
    residuals = {"appearance": gaussians.appearance_coefficients, "spectral_motion": gaussians.motion_coefficients}
    for name, coefficients in residuals.items():
        if active or coefficients is not None:  # before their activation no model has them
            yield f"model.{name}", coefficients is not None
        if coefficients is not None:
            yield "model.frequencies", coefficients.shape[1] // 2
