"""One case of a benchmark, measured in its own process: times by stage, pairs and memory for given sizes.

The timed iteration is one of the published schedule with all components, all losses and the statistics of density
control. Densification, which runs once per interval, is timed afterwards.
"""

import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from endotsr.config import PAPER, Config, with_settings
from endotsr.method.kernels.constants import Y00
from endotsr.results.export.npz import read_arrays
from endotsr.studies.bench.clock import SPLAT, StageClock, spread
from endotsr.studies.bench.records import CaseTimes, Densification, ViewCounts
from endotsr.training.scene import workload
from endotsr.training.scene.gaussians import Gaussians, arrays

if TYPE_CHECKING:
    from endotsr.training.fitting.state import TrainingConstants, TrainingState

Precision = Literal["float32", "float64"]

WARM_UP = 2  # iterations after the first one, which compiles
DEPTH = 4.0  # depth of the middle of a trained scene, scene units; as in the common workload
SEED = 7  # of the time-dependent parameters of a trained scene
PERCENTILES = (1, 99)  # of the positions of a trained scene: the range scaled to the picture


@dataclass(frozen=True)
class BenchCase:
    """The sizes of a case; the defaults are the common workload at 60 000 Gaussians."""

    gaussians: int = 60_000
    width: int = workload.WIDTH
    height: int = workload.HEIGHT
    precision: Precision = "float32"
    threads: int = 2
    repeats: int = 11
    bases: int = PAPER.model.bases
    frequencies: int = PAPER.model.frequencies
    frames: int = workload.FRAMES
    size: float = 1.0  # factor on the semi-axes of the Gaussians
    scene: str | None = None  # file of a trained scene instead of the common workload; ignores `gaussians`
    densifications: int = 2  # timed densifications after the iterations

    def config(self) -> Config:
        """The published settings with the sizes of this case."""
        training = {"precision": self.precision, "threads": self.threads}
        return with_settings(PAPER, training=training, model={"bases": self.bases, "frequencies": self.frequencies})


def apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of `function(*arguments)` in a new process, which has its own peak memory."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        return pool.submit(function, *arguments).result()


def measure(case: BenchCase) -> CaseTimes:
    """Measure a case. Call it through `apart`."""
    from endotsr.method.kernels.threads import use_threads
    from endotsr.training.runs.machine import peak_memory_bytes

    use_threads(case.threads)
    config = case.config()
    state, constants = prepare(case, config)
    first, times = time_iterations(state, constants, case.repeats)
    peak = peak_memory_bytes()
    numbers = sum(a.size for a in arrays(state.gaussians).values())
    return {
        "case": asdict(case) | {"gaussians": state.gaussians.count, "scene": case.scene and Path(case.scene).stem},
        "stages": {name: spread([t[name] for t in times]) for name in times[0]},
        "splat": spread([sum(t[name] for name in SPLAT) for t in times]),
        "iteration": spread([sum(t.values()) for t in times]),
        "first_iteration_s": first,
        "view": _view(state, constants),
        "parameters": numbers // state.gaussians.count,
        "peak_memory_bytes": peak,
        "densification": _densification(state, constants, case.densifications),
    }


def prepare(case: BenchCase, config: Config) -> tuple["TrainingState", "TrainingConstants"]:
    """State and constants of a case at the timed iteration, with the pyramid supports of every frame."""
    from endotsr.training.fitting.state import bench_state, training_constants

    constants = training_constants(workload.sequence(case.width, case.height, frames=case.frames), config)
    for index in constants.sequence.train_index:
        constants.targets_of(int(index))  # caches the supports, which a run computes once per frame
    if case.scene:
        scene = trained_gaussians(Path(case.scene), config)
    else:
        scene = workload.gaussians(case.gaussians, config, size=case.size)
    return bench_state(scene, config, representative(config)), constants


def trained_gaussians(path: Path, config: Config) -> Gaussians:
    """A trained scene, scaled to fill the picture of the common camera, with small random time-dependent parameters.

    path   npz, see `export.npz`
    Raises: InputError naming the file and the missing array.
    """
    found = read_arrays(path)
    position, log_scale = found["xyz"].T.astype(np.float64), found["log_scale"].T.astype(np.float64)
    low, high = np.percentile(position, PERCENTILES, axis=1)
    across = max((high - low)[0] / workload.WIDTH, (high - low)[1] / workload.HEIGHT)  # scene units per pixel
    factor = DEPTH / workload.FOCAL / across
    middle = (low + high)[:, None] / 2
    opacity = np.clip(found["opacity"].astype(np.float64), 1e-4, 1 - 1e-4)
    harmonics = np.zeros(((config.model.harmonics_degree + 1) ** 2, 3, opacity.size))
    harmonics[0] = (found["rgb"].T - 0.5) / Y00
    dtype = np.dtype(config.training.precision)
    cast = lambda array: np.ascontiguousarray(array, dtype)
    scene = Gaussians(
        position=cast((position - middle) * factor + np.array([[0.0], [0.0], [DEPTH]])),
        quaternion=cast(found["quat_wxyz"].T),
        log_scale=cast(log_scale + np.log(factor)),
        opacity_logit=cast(np.log(opacity / (1 - opacity))),
        harmonics=cast(harmonics),
    )
    sigma = float(np.exp(np.median(scene.log_scale)))
    return scene._replace(**workload.temporal(np.random.default_rng(SEED), opacity.size, config, sigma))


def time_iterations(
    state: "TrainingState", constants: "TrainingConstants", repeats: int
) -> tuple[float, list[dict[str, float]]]:
    """Repeat the same iteration of the schedule, after warm-up.

    returns  seconds of the first iteration, with compilation or loading of compiled code; and for each repeat the
             seconds by stage, whose sum is the iteration
    """
    from endotsr.training.fitting.trainer import training_step

    iteration, clock = state.iteration, StageClock()
    began = time.perf_counter()
    training_step(state, constants)
    first = time.perf_counter() - began
    for _ in range(WARM_UP + repeats):
        state.iteration = iteration
        with clock.iteration():
            training_step(state, constants, clock)
    return first, clock.repeats[WARM_UP:]


def representative(config: Config) -> int:
    """An iteration at which residuals, Laplacian loss and statistics are active, but without densification."""
    t, loss = config.training, config.loss
    start = max(t.residual_activation + 1, loss.laplacian_full, loss.smoothness_from)
    return start + config.density.interval // 2


def _view(state: "TrainingState", constants: "TrainingConstants") -> ViewCounts:
    """Visible Gaussians, entries of the tile lists and blended pairs of the first training view."""
    from endotsr.method.splatting.render import render_forward
    from endotsr.studies.bench.pairs import count_pairs
    from endotsr.training.fitting.model import raster_settings, scene_at

    model, index = constants.config.model, int(constants.sequence.train_index[0])
    scene, _ = scene_at(state.gaussians, constants.spectral, model, float(constants.sequence.times[index]))
    settings = raster_settings(constants.config)
    _, saved = render_forward(scene, constants.sequence.cameras[index], settings, degree=model.harmonics_degree)
    listed = int(saved.composite.lists.ranks.size)
    return {"visible": int(saved.order.size), "listed": listed, "blended": count_pairs(saved).blended}


def _densification(state: "TrainingState", constants: "TrainingConstants", repeats: int) -> Densification | None:
    """Time of the densification within an iteration. It changes the scene, hence few repeats."""
    from endotsr.training.fitting.trainer import training_step

    if repeats == 0:
        return None
    interval, clock = constants.config.density.interval, StageClock()
    for _ in range(1 + repeats):  # the first one loads the kernels
        state.iteration = -(-state.iteration // interval) * interval - 1
        with clock.iteration():
            training_step(state, constants, clock)
    seconds = [t["density control"] for t in clock.repeats[1:]]
    per_iteration = float(np.median(seconds)) * 1e3 / interval
    return {**spread(seconds), "per_iteration_ms": per_iteration, "gaussians": state.gaussians.count}
