"""The rendered scene: a simulated scene or a trained run at one time, or a file of Gaussians.

A file is a 3DGS `.ply` (`export.ply`) or an `.npz` (`export.npz`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.config import DEMO, ModelConfig, with_iterations, with_settings
from endotsr.errors import InputError
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.camera import Camera, scale_camera
from endotsr.results.export.npz import read_arrays
from endotsr.results.export.ply import read_gaussians, sound
from endotsr.results.export.scene import NEAR, STILL, facing_camera
from endotsr.training.scene.gaussians import Gaussians, arrays

SIMULATED_WIDTH, SIMULATED_HEIGHT = 128, 96
ITERATIONS = 150  # of the training on the simulated sequence
POINTS = {"first_frame_points": 2500, "other_frame_points": 400}
SIDE = 320  # side of the picture for a file, pixels
OPACITY_STEP = 1 / 255  # of 8-bit opacities; 0 and 1 are replaced by values half a step inside


@dataclass(frozen=True)
class StudyScene:
    """Gaussians, a time and a camera."""

    name: str
    about: str  # description, one sentence
    gaussians: Gaussians
    spectral: Any  # `fitting.model.Spectral`; None without Fourier components
    model: ModelConfig
    time: float
    camera: Camera
    near: float  # scene units
    noise: float | None  # standard deviation of the sensor noise, display units; None = unknown

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
    step: Callable[[], None] = lambda: None,
) -> StudyScene:
    """A model of the simulated sequence after a short training with every component, at picture width `width`.

    step   called after every iteration
    """
    from endotsr.clips.simulator.settings import SimulatorSettings
    from endotsr.clips.simulator.simulate import simulate
    from endotsr.training.fitting.model import spectral_from
    from endotsr.training.fitting.state import new_training
    from endotsr.training.fitting.trainer import train

    height = width * SIMULATED_HEIGHT // SIMULATED_WIDTH
    simulator = SimulatorSettings(width=width, height=height)
    sequence = simulate(simulator).sequence
    fraction = (width / SIMULATED_WIDTH) ** 2  # the number of points is proportional to the number of pixels
    points = {name: max(4, round(count * fraction)) for name, count in POINTS.items()}
    config = with_settings(with_iterations(DEMO, iterations), initialisation=points)
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
    """The latest checkpoint of a run at its middle held-out frame, or training frame if none is held out.

    Raises: InputError for a run without checkpoint.
    """
    from endotsr.training.fitting.model import corrected_cameras
    from endotsr.training.runs.folder import open_run
    from endotsr.training.runs.model import load_model

    folder = open_run(path)
    model = load_model(folder)
    record = folder.sequence_record()
    cameras = corrected_cameras(model.frames, record.frame_cameras, record.times)
    frames = record.test_index or record.train_index
    frame = frames[len(frames) // 2]
    kind = "held-out" if record.test_index else "training"
    return StudyScene(
        Path(path).resolve().name,
        f"run after {model.iteration} iterations, {kind} frame {frame}",
        model.gaussians,
        model.spectral,
        model.config.model,
        record.times[frame],
        scaled(cameras[frame], scale),
        model.config.raster.near,
        None,
    )


def splat_scene(path: Path, side: int = SIDE) -> StudyScene:
    """The Gaussians of a file, in a square picture from the front. Raises InputError naming file and reason."""
    path = Path(path)
    gaussians = read_splats(path)
    camera = facing_camera(gaussians.position, side)
    distance = float(camera.translation[2] + np.median(gaussians.position[2]))
    return StudyScene(
        path.stem.removesuffix("_splats"),
        f"{path.name}, {gaussians.count} trained Gaussians seen from the front",
        gaussians, None, STILL, 0.0, camera, near=NEAR * distance, noise=None,
    )  # fmt: skip


def read_splats(path: Path) -> Gaussians:
    """The Gaussians of a file, float32, without those that are not finite. Raises InputError."""
    kind = path.suffix.lower()
    if kind not in (".ply", ".npz"):
        raise InputError(f"{path}: not a splat file; use a name that ends in .ply or .npz")
    if kind == ".ply":
        return read_gaussians(path)
    data = read_arrays(path)
    opacity = np.clip(data["opacity"].astype(np.float64), OPACITY_STEP / 2, 1 - OPACITY_STEP / 2)
    colour = (data["rgb"].astype(np.float64) - 0.5) / Y00
    logit = np.log(opacity / (1 - opacity))
    return sound(Gaussians(data["xyz"].T, data["quat_wxyz"].T, data["log_scale"].T, logit, colour.T[None]), path)


def scaled(camera: Camera, scale: float) -> Camera:
    """The camera with its picture scaled by `scale` and rounded to whole pixels."""
    return scale_camera(camera, max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))


def in_precision(gaussians: Gaussians, dtype: str) -> Gaussians:
    """The Gaussians with all arrays cast to `dtype`."""
    return gaussians._replace(**{name: np.ascontiguousarray(a, dtype) for name, a in arrays(gaussians).items()})
