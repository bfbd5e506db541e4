"""From a run folder to a model that renders, or to a training that continues.

A checkpoint is read with the settings of config.toml. If the two are not of one run (an edited file, a checkpoint
copied in), the arrays would be misread, so every setting is compared first, and the fingerprint of the sequence with
that of run.json.
"""

import hashlib
import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.runs.files import warn
from endotsr.runs.folder import RunFolder
from endotsr.runs.records import RunRecord
from endotsr.untrusted.toml import by_key

if TYPE_CHECKING:
    from endotsr.fitting.checkpoint import Checkpoint
    from endotsr.scene.gaussians import Gaussians
    from endotsr.scene.parameters import FrameParameters

CHANGE_NO_NUMBER = {  # settings that may differ from the checkpoint's; the length of the run is `training.iterations`
    "preset",
    "training.threads",
    "training.checkpoint_every",
    "training.visits_per_frame",
}


class Model(NamedTuple):
    """Everything that rendering needs."""

    gaussians: "Gaussians"
    spectral: Any  # frequencies, atom statistics and penalty weights of the training time stamps
    config: Config
    iteration: int
    frames: "FrameParameters | None" = None  # parameters of the training frames; None if the model has none


def load_model(folder: RunFolder) -> Model:
    """The model of the latest checkpoint. Raises InputError if there is none, it is damaged or of other settings."""
    from endotsr.fitting.model import spectral_from

    if not folder.has_checkpoint:
        raise InputError(
            f"{folder.path}: no checkpoint yet; continue the run with `endotsr train --out {folder.path} --resume`"
        )
    config, record = folder.config(), folder.sequence_record()
    checkpoint, _ = _checkpoint_of(folder, config)
    spectral = spectral_from(config.model, record.train_times)
    return Model(checkpoint.gaussians, spectral, config, checkpoint.iteration, checkpoint.frames)


def save_training(folder: RunFolder, state: Any, config: Config) -> None:
    """Replace the last checkpoint by the state of a training; it names the sequence of run.json."""
    from endotsr.fitting.state import save_state

    save_state(folder.checkpoint, state, config, sequence_fingerprint(folder.record()))


def load_training(folder: RunFolder, config: Config, *, continues: bool = False) -> Any:
    """The training at its latest whole checkpoint. Raises InputError if there is none, or it is of other settings.

    continues   the caller holds the lock of the folder and will write checkpoints: a damaged one is put aside as
                checkpoint.damaged.npz, so that it never takes the place of the one before it
    """
    from endotsr.fitting.state import state_from_checkpoint

    checkpoint, damaged = _checkpoint_of(folder, config)
    try:
        state = state_from_checkpoint(checkpoint, config)
    except InputError as error:
        raise InputError(f"{folder.checkpoint}: {error}") from None
    if damaged and continues:
        folder.checkpoint.replace(folder.path / "checkpoint.damaged.npz")
    return state


def _checkpoint_of(folder: RunFolder, config: Config) -> tuple["Checkpoint", bool]:
    """The latest whole checkpoint, and whether a later one is damaged (a warning names it).

    It must be of a training with these settings on the sequence of run.json.
    """
    from endotsr.fitting.checkpoint import load_latest

    checkpoint, note = load_latest(folder.checkpoint)
    if note:
        warn(note)
    trained_on, recorded = checkpoint.header.get("sequence"), sequence_fingerprint(folder.record())
    if trained_on is not None and recorded is not None and trained_on != recorded:
        raise InputError(
            f"{folder.checkpoint}: trained on another sequence than the one in {folder.path / 'run.json'}; "
            "allowed: checkpoint and records of one run, as it wrote them"
        )
    asked = by_key(msgspec.json.decode(msgspec.json.encode(config)))  # as JSON, which the checkpoint holds
    for key, value in (*by_key(checkpoint.header.get("config")).items(), *_seen_in_arrays(checkpoint, config)):
        if key in asked and key not in CHANGE_NO_NUMBER and asked[key] != value:
            raise InputError(
                f"{folder.checkpoint}: trained with {key} = {value!r}, but {folder.path / 'config.toml'} says "
                f"{asked[key]!r}; allowed: checkpoint and settings of one run, as it wrote them"
            )
    return checkpoint, bool(note)


def sequence_fingerprint(record: RunRecord) -> str | None:
    """SHA-256 over the hashes of the pictures, times and cameras in run.json; None where it holds none."""
    hashes = record.get("input", {}).get("arrays_sha256")
    return hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest() if hashes else None


def _seen_in_arrays(checkpoint: "Checkpoint", config: Config) -> Iterator[tuple[str, Any]]:
    """The settings that can be read from the arrays themselves."""
    from endotsr.fitting.schedules import residuals_active
    from endotsr.scene.parameters import trained

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
        if active or coefficients is not None:  # before their activation they are missing in any model
            yield f"model.{name}", coefficients is not None
        if coefficients is not None:
            yield "model.frequencies", coefficients.shape[1] // 2
