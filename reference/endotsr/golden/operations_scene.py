"""Operations of the whole method: the moving scene, the objective (6) with every gradient, a training trajectory."""

from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config, ModelConfig, config_from_dict
from endotsr.equations.deformation import deformation_reverse
from endotsr.equations.laplacian import LEVELS, laplacian_loss_forward, laplacian_loss_reverse, support_masks
from endotsr.equations.matern import matern_penalty_forward, matern_penalty_reverse
from endotsr.fitting.adam import adam_state
from endotsr.fitting.model import Spectral, scene_at, scene_reverse, spectral_from
from endotsr.fitting.objective import Targets, calibrate_on, photometric_loss
from endotsr.fitting.trainer import TrainingState, training_step, workshop
from endotsr.golden.operation import Asked, Inputs, Operation, Settings, real_of
from endotsr.golden.operations_splatting import camera_of, compositor_of, raster_of
from endotsr.losses.depth import depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.losses.masked_ssim import masked_ssim_forward, ssim_target
from endotsr.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.scene.density_control import empty_statistics
from endotsr.scene.gaussians import Gaussians, arrays
from endotsr.sequences.sequence import Sequence
from endotsr.splatting.camera import Camera
from endotsr.splatting.render import render_forward, render_reverse

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
    weights, gaussians = settings["loss"], gaussians_of(inputs)
    spectral, camera = spectral_of(inputs, settings), camera_of(inputs, settings)
    scene, scene_saved = scene_at(gaussians, spectral, model_of(settings), settings["t"])
    rendered, saved = render_forward(
        scene, camera, raster_of(settings), degree=settings["degree"], compositor=compositor_of(settings)
    )
    ssim = ssim_target(inputs["observed"], inputs["mask"])
    targets = Targets(ssim.image, ssim.mask, ssim, None, None)
    photometric = photometric_loss(rendered.colour, targets, weights["ssim_weight"])
    d_colour = photometric.d_colour
    depth, depth_saved = normalised_depth_forward(rendered.depth, depth_target(inputs["prior_depth"], ssim.mask))
    d_depth = normalised_depth_reverse(weights["depth_weight"], depth_saved)
    smooth, smooth_saved = smoothness_forward(
        rendered.depth, rendered.colour, ssim.mask, inputs["edges"], weights["total_variation_factor"]
    )
    smooth_grads = smoothness_reverse(weights["smoothness_weight"], smooth_saved)
    supports = support_masks(ssim.mask, LEVELS, weights["upsampling"])
    detail, detail_saved = laplacian_loss_forward(rendered.colour, ssim.image, supports, weights["upsampling"])
    d_colour = d_colour + smooth_grads.rendered + laplacian_loss_reverse(weights["lambda_lap"], detail_saved)
    loss = (
        photometric.loss
        + weights["depth_weight"] * depth
        + weights["smoothness_weight"] * smooth
        + weights["lambda_lap"] * detail
    )
    back = scene_reverse(render_reverse(d_colour, d_depth + smooth_grads.rendered_depth, None, saved), scene_saved)
    found: Found = {f"d_{name}": value for name, value in back.by_field.items()}
    if gaussians.motion_coefficients is not None:
        penalty, penalty_saved = matern_penalty_forward(gaussians.motion_coefficients, spectral.rho)
        loss += weights["lambda_msp"] * penalty
        found["term_penalty"] = penalty
        extra = matern_penalty_reverse(weights["lambda_msp"], penalty_saved)
        found["d_motion_coefficients"] = back.by_field["motion_coefficients"] + extra
    if scene_saved.deformation is not None:
        assert back.offsets is not None
        fdm = deformation_reverse(back.offsets, scene_saved.deformation)
        found |= {"d_fdm_weight": fdm.weight, "d_fdm_centre": fdm.centre, "d_fdm_width": fdm.width}
    return found | {
        "colour_image": rendered.colour,
        "depth_image": rendered.depth,
        "term_l1": photometric.terms["l1"],
        "term_ssim": masked_ssim_forward(rendered.colour, ssim)[0],
        "term_depth": depth,
        "term_smoothness": smooth,
        "term_laplacian": detail,
        "objective": loss,
    }


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


def sequence_of(inputs: Inputs, lens: dict[str, float]) -> Sequence:
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
    sequence = sequence_of(inputs, settings["camera"])
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
