"""A small moving model with every component, made of random numbers."""

import msgspec
import numpy as np

from endotsr.clips.sequences.record import SequenceRecord, recorded
from endotsr.config import PAPER
from endotsr.method.splatting.camera import Camera
from endotsr.results.export.scene import MovingScene
from endotsr.training.fitting.model import spectral_from
from endotsr.training.runs.model import Model
from endotsr.training.scene.gaussians import Gaussians
from endotsr.training.scene.parameters import FrameParameters

CAMERA = Camera(np.eye(3), np.zeros(3), 60.0, 60.0, 32.0, 24.0, 64, 48)


def moving_scene(count=80, seed=0, exposure=False, frames=4):
    rng = np.random.default_rng(seed)

    def normal(*shape, scale=1.0):
        return (scale * rng.normal(size=shape)).astype(np.float32)

    bases, atoms = 5, 8
    position = (np.array([[0.0], [0.0], [10.0]]) + normal(3, count, scale=2)).astype(np.float32)
    gaussians = Gaussians(
        position, normal(4, count), normal(3, count, scale=0.3) - 1, normal(count), normal(16, 3, count, scale=0.2),
        normal(10, bases, count, scale=0.2), rng.uniform(0, 1, (10, bases, count)).astype(np.float32),
        normal(10, bases, count, scale=0.2), *(normal(3, 2 * atoms, count, scale=0.1) for _ in range(2)),
    )  # fmt: skip
    model = msgspec.structs.replace(PAPER.model, bases=bases, frequencies=atoms, exposure=exposure)
    config = msgspec.structs.replace(PAPER, model=model)
    times = [k / frames for k in range(frames)]
    exposures = FrameParameters(np.array([0.0, 0.5, 0.75]), normal(3, 3, scale=0.1), normal(3, 3, scale=0.1))
    record = SequenceRecord(
        unit="mm", largest_depth=15.0, static_camera=True, times=times, names=[f"frame {k}" for k in range(frames)],
        train_index=[0, 2, 3], test_index=[1], cameras=recorded([CAMERA]),
    )  # fmt: skip
    spectral = spectral_from(config.model, np.array(times)[[0, 2, 3]])
    return MovingScene(record, Model(gaussians, spectral, config, 7, exposures if exposure else None))
