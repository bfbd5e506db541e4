"""A small moving scene, made without training."""

import msgspec
import numpy as np

from endotsr.config import PAPER, ModelConfig
from endotsr.studies.tradeoff.scenes import StudyScene
from endotsr.training.fitting.model import spectral_from
from endotsr.training.scene import workload


def moving_scene(count: int = 48, width: int = 40, seed: int = 7) -> StudyScene:
    """Gaussians of a few pixels with time bases, colour and motion residuals."""
    model = ModelConfig(bases=3, frequencies=2, initial_width=0.2)
    training = msgspec.structs.replace(PAPER.training, precision="float64")
    config = msgspec.structs.replace(PAPER, model=model, training=training)
    gaussians = workload.gaussians(count, config, seed)
    times = np.arange(12) / 12
    return StudyScene(
        "made up", "made-up scene", gaussians, spectral_from(model, times), model, 0.4,
        workload.camera(width, width * 4 // 5), near=0.2, noise=0.01,
    )  # fmt: skip
