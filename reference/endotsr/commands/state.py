"""From a run folder to a model that renders, or to a training that goes on."""

from typing import TYPE_CHECKING, Any, NamedTuple

from endotsr.config import Config
from endotsr.errors import InputError
from endotsr.runs import RunFolder

if TYPE_CHECKING:
    from endotsr.scene.gaussians import Gaussians


class Model(NamedTuple):
    """What is needed to render."""

    gaussians: "Gaussians"
    spectral: Any  # frequencies, atom statistics and penalty weights of the training time stamps
    config: Config
    iteration: int


def load_model(folder: RunFolder) -> Model:
    """The model of the latest checkpoint. Raises InputError if there is none or it is damaged."""
    import numpy as np

    from endotsr.fitting.checkpoint import load_checkpoint
    from endotsr.fitting.model import spectral_from

    if not folder.checkpoint.exists():
        raise InputError(f"{folder.path}: no checkpoint yet; continue the run with `endotsr train --resume`")
    checkpoint, config, record = (
        load_checkpoint(folder.checkpoint),
        folder.config(),
        folder.sequence_record("times", "train_index"),
    )
    times = np.array(record["times"])[record["train_index"]]
    spectral = spectral_from(config.model, times)
    return Model(checkpoint.gaussians, spectral, config, checkpoint.iteration)


def save_training(folder: RunFolder, state: Any, config: Config) -> None:
    """Put the state of a training in place of the last checkpoint."""
    from endotsr.fitting.trainer import save_state

    save_state(folder.checkpoint, state, config)


def load_training(folder: RunFolder, config: Config) -> Any:
    """The training at its last checkpoint."""
    from endotsr.fitting.checkpoint import load_checkpoint
    from endotsr.fitting.trainer import state_from_checkpoint

    return state_from_checkpoint(load_checkpoint(folder.checkpoint), config)
