"""The rendered scene: one moment of a simulated scene, of a trained run, or of a file of Gaussians."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from endotsr.config import DEMO, ModelConfig, with_iterations
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.splatting.camera import Camera, scale_camera

SIMULATED_WIDTH, SIMULATED_HEIGHT = 128, 96
ITERATIONS = 150  # of the training that gives the simulated scene its Gaussians
POINTS = {"first_frame_points": 2500, "other_frame_points": 400}


@dataclass(frozen=True)
class StudyScene:
    """Gaussians, a moment and a camera."""

    name: str
    about: str  # one sentence
    gaussians: Gaussians
    spectral: Any  # `fitting.model.Spectral`; None without Fourier components
    model: ModelConfig
    time: float
    camera: Camera
    near: float  # scene units
    noise: float | None  # standard deviation of the sensor noise of the pictures, display units; None = not known

    @property
    def degree(self) -> int:
        """Highest harmonic degree of the Gaussians."""
        return int(np.sqrt(self.gaussians.harmonics.shape[0])) - 1

    @property
    def bases(self) -> int:
        """B, or 0 without deformation."""
        return 0 if self.gaussians.fdm_weight is None else self.gaussians.fdm_weight.shape[1]

    @property
    def frequencies(self) -> int:
        """F, or 0 without Fourier components."""
        for a in (self.gaussians.appearance_coefficients, self.gaussians.motion_coefficients):
            if a is not None:
                return a.shape[1] // 2
        return 0


def simulated_scene(
    iterations: int = ITERATIONS,
    width: int = SIMULATED_WIDTH,
    seed: int = 0,
    step: Callable[[], None] = lambda: None,
) -> StudyScene:
    """The simulated sequence after a short training with every component, in a picture `width` wide.

    step   is called after every iteration
    """
    from endotsr.fitting.model import spectral_from
    from endotsr.fitting.state import new_training
    from endotsr.fitting.trainer import train
    from endotsr.simulator.settings import SimulatorSettings
    from endotsr.simulator.simulate import simulate

    height = width * SIMULATED_HEIGHT // SIMULATED_WIDTH
    simulator = SimulatorSettings(width=width, height=height, seed=seed)
    sequence = simulate(simulator).sequence
    config = with_iterations(DEMO, iterations)
    fraction = (width / SIMULATED_WIDTH) ** 2  # of the pixels, and so of the points
    points = {name: max(4, round(count * fraction)) for name, count in POINTS.items()}
    config = msgspec.structs.replace(config, initialisation=msgspec.structs.replace(config.initialisation, **points))
    state = new_training(sequence, config)
    train(state, sequence, config, lambda entry: step(), lambda reached: None)
    frame = int(sequence.test_index[len(sequence.test_index) // 2])
    return StudyScene(
        "simulated",
        f"simulated sequence, {iterations} iterations of training, held-out frame {frame}",
        state.gaussians,
        spectral_from(config.model, sequence.times[sequence.train_index]),
        config.model,
        float(sequence.times[frame]),
        sequence.cameras[frame],
        config.raster.near,
        simulator.noise.sigma,
    )


def run_scene(path: Path, scale: float = 1.0) -> StudyScene:
    """The latest checkpoint of a run at its middle held-out frame. Raises InputError for a run that has none."""
    from endotsr.fitting.model import corrected_cameras
    from endotsr.runs.folder import open_run
    from endotsr.runs.model import load_model

    folder = open_run(path)
    model = load_model(folder)
    record = folder.sequence_record()
    cameras = corrected_cameras(model.frames, record.frame_cameras, record.times)
    frame = record.test_index[len(record.test_index) // 2]
    return StudyScene(
        Path(path).resolve().name,
        f"run after {model.iteration} iterations, held-out frame {frame}",
        model.gaussians,
        model.spectral,
        model.config.model,
        record.times[frame],
        scaled(cameras[frame], scale),
        model.config.raster.near,
        None,
    )


def scaled(camera: Camera, scale: float) -> Camera:
    """The camera with a picture `scale` times as wide and high, in whole pixels."""
    return scale_camera(camera, max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))


def in_precision(gaussians: Gaussians, dtype: str) -> Gaussians:
    """Every array in another precision."""
    return gaussians._replace(**{name: np.ascontiguousarray(a, dtype) for name, a in arrays(gaussians).items()})
