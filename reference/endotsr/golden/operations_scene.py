"""Operations of the whole method: the moving scene, the objective (6) with every gradient, a training trajectory."""

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config, LossConfig, ModelConfig, config_from_dict
from endotsr.fitting.adam import adam_state
from endotsr.fitting.model import Spectral, scene_at, spectral_from
from endotsr.fitting.objective import LossWeights, calibrate_on, frame_targets
from endotsr.fitting.state import TrainingState, workshop
from endotsr.fitting.trainer import training_step
from endotsr.fitting.view import view_gradients
from endotsr.golden.operation import Asked, Inputs, Operation, Settings, real_of
from endotsr.golden.operations_splatting import camera_of, compositor_of, raster_of
from endotsr.scene.density_control import empty_statistics
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.sequences.sequence import Frame, Sequence
from endotsr.splatting.camera import Camera

Found = dict[str, NDArray | float | None]


def gaussians_of(inputs: Inputs) -> Gaussians:
    """Raw parameters of a request; what is not there is a component that is off."""
    return Gaussians(*(inputs.get(name) for name in Gaussians._fields))  # type: ignore[arg-type]


def model_of(settings: Settings) -> ModelConfig:
    """The model settings written out in a case."""
    return msgspec.convert(settings["model"], ModelConfig)


def spectral_of(inputs: Inputs, settings: Settings) -> Spectral:
    """Frequencies, statistics and weights of a request."""
    return spectral_from(model_of(settings), inputs["times"][inputs["train_index"]].astype(np.float64))


def _scene(inputs: Inputs, settings: Settings) -> Found:
    model = model_of(settings)
    scene, _ = scene_at(gaussians_of(inputs), spectral_of(inputs, settings), model, settings["t"])
    names = ("position", "quaternion", "log_scale", "residual")
    return {f"{name}_at_t": getattr(scene, name) for name in names}


def _objective(inputs: Inputs, settings: Settings) -> Found:
    """Equation (6) of one view; the edges of the smoothness term are an input, so that no edge detector is needed."""
    loss, gaussians = msgspec.convert(settings["loss"], LossConfig), gaussians_of(inputs)
    assert isinstance(loss.lambda_lap, float)
    config, camera = Config(model=model_of(settings), loss=loss), camera_of(inputs, settings)
    targets = frame_targets(
        Frame(inputs["observed"], inputs["mask"], inputs["prior_depth"], settings["t"], camera), config
    )
    weights = LossWeights(loss.ssim_weight, loss.depth_weight, loss.smoothness_weight, loss.lambda_lap)
    view = view_gradients(
        gaussians, spectral_of(inputs, settings), targets, weights, config, camera, settings["t"], inputs["edges"],
        raster=raster_of(settings), degree=settings["degree"], compositor=compositor_of(settings),
    )  # fmt: skip
    names = {"term_penalty": "matern_penalty"} | {f"term_{n}": n for n in ("l1", "ssim", *LossWeights._fields[1:])}
    terms: Found = {name: view.terms[term] for name, term in names.items() if term in view.terms}
    images = {"colour_image": view.rendered.colour, "depth_image": view.rendered.depth}
    gradients: Found = {f"d_{name}": gradient for name, gradient in view.gradients.items()}
    return gradients | images | terms | {"objective": view.loss}


class Tape:
    """Stands in for the random generator of a run: frames and split noise come from the inputs, in order."""

    def __init__(self, frames: NDArray, noise: NDArray) -> None:
        self.frames, self.noise = list(map(int, frames)), noise

    def integers(self, high: int) -> int:
        """The next frame, as a position within the training frames."""
        frame = self.frames.pop(0)
        if not 0 <= frame < high:
            raise ValueError(f"frame {frame} of {high}")
        return frame

    def standard_normal(self, shape: tuple[int, int, int]) -> NDArray:
        """[child, axis, Gaussian]: the first columns of the noise."""
        return np.ascontiguousarray(self.noise[:, :, : shape[2]], np.float64)


def sequence_of(inputs: Inputs, lens: dict[str, float], near: float) -> Sequence:
    """The frames of a request; without stamps, frame k of n is at k / n."""
    poses = zip(inputs["rotation_matrices"], inputs["translations"])
    count = len(inputs["images"])
    train = inputs["train_index"].astype(np.intp)
    return Sequence(
        images=inputs["images"].astype(np.uint8),
        masks=inputs["masks"],
        depth=inputs["prior_depths"].astype(np.float32),
        times=np.asarray(inputs.get("times", np.arange(count) / count), np.float64),
        cameras=[Camera(r.astype(np.float64), d.astype(np.float64), **lens) for r, d in poses],  # type: ignore[arg-type]
        names=[str(k) for k in range(count)],
        near=near,
        unit="scene unit",
        static_camera=False,
        train_index=train,
        test_index=np.setdiff1d(np.arange(count), train),
    )


def config_of(settings: Settings, dtype: np.dtype) -> Config:
    """The complete configuration of a training case, in the precision of the request."""
    data: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(settings["config"]))
    data["training"]["precision"] = np.dtype(dtype).name
    return config_from_dict(data, "golden case")


def _training(inputs: Inputs, settings: Settings) -> Found:
    """Calibrate on the first Gaussians, then train; component A and S are born on the way, densification happens."""
    dtype = real_of({"position": inputs["position"]})
    config = config_of(settings, dtype)
    sequence = sequence_of(inputs, settings["camera"], config.raster.near)
    gaussians = Gaussians(**{name: a.copy() for name, a in arrays(gaussians_of(inputs)).items()})
    shop = workshop(sequence, config)
    weight = calibrate_on(gaussians, shop.spectral, sequence, config).lambda_lap
    tape: Any = Tape(inputs["frame_order"], inputs["split_noise"])
    state = TrainingState(gaussians, adam_state(arrays(gaussians)), 0, tape, empty_statistics(gaussians.count), weight)
    log = [training_step(state, shop) for _ in range(config.training.iterations)]
    found: Found = {f"final_{name}": a for name, a in arrays(state.gaussians).items()}
    return found | {
        "lambda_lap": weight,
        "loss": np.array([entry["loss"] for entry in log]),
        "count": np.array([entry["gaussians"] for entry in log] + [state.gaussians.count], np.int64),
    }


def _determinism(inputs: Inputs, settings: Settings) -> Found:
    """The objective twice: the second answer must have the bits of the first."""
    names = ("objective", "d_position", "d_harmonics")
    first, second = (_objective(inputs, settings) for _ in range(2))
    return {f"{name}_1": first[name] for name in names} | {f"{name}_2": second[name] for name in names}


UNITS = {"position": "loss per scene unit", "motion_coefficients": "loss per scene unit"}
FIELDS = Gaussians._fields

OPERATIONS = [
    Operation("scene", "2", "raw parameters at time t, every component applied", _scene, {
        "position_at_t": Asked(1, "scene unit", "last", "residuals_oracle.linear"),
        "quaternion_at_t": Asked(1, "1", "last", "deformation.offsets"),
        "log_scale_at_t": Asked(1, "1", "last", "deformation.offsets"),
        "residual_at_t": Asked(1, "display / Y00", "last", "residuals_oracle.colour_residual"),
    }),
    Operation("objective", "6", "moving scene, render, full loss, every gradient", _objective, {
        "colour_image": Asked(3, "display", oracle="splatting_oracle.render"),
        "depth_image": Asked(3, "scene unit", oracle="splatting_oracle.render"),
        "term_l1": Asked(3, "display", oracle="losses.masked_l1"),
        "term_ssim": Asked(3, oracle="losses.masked_ssim"),
        "term_depth": Asked(3, oracle="losses.normalised_depth"),
        "term_smoothness": Asked(3, "scene unit^2", oracle="losses.smoothness"),
        "term_laplacian": Asked(3, "display", oracle="laplacian_oracle.loss"),
        "term_penalty": Asked(3, "scene unit^2", oracle="matern_oracle.penalty"),
        "objective": Asked(3, "loss", oracle="losses.masked_l1"),
        **{f"d_{name}": Asked(3, UNITS.get(name, "loss"), "last") for name in FIELDS},
    }, lambda s: ("objective",)),
    Operation("training", "6", "calibration and twenty iterations", _training, {
        "lambda_lap": Asked(4), "loss": Asked(4, "loss"), "count": Asked(4, scale="exact"),
        **{f"final_{name}": Asked(4, "raw parameter", "max") for name in FIELDS},
    }),
    Operation("determinism", "6", "the objective computed twice", _determinism, {
        **{f"{name}_1": Asked(5, "loss") for name in ("objective", "d_position", "d_harmonics")},
        **{f"{name}_2": Asked(5, "loss", f"identical {name}_1") for name in ("objective", "d_position", "d_harmonics")},
    }),
]  # fmt: skip
