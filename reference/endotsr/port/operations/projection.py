"""Operations from raw Gaussians to the screen: covariance (B2), projection (B3), colour from harmonics (B4)."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.method.splatting import covariance
from endotsr.method.splatting.covariance import Shape, covariance_forward
from endotsr.method.splatting.harmonics import HarmonicsSaved, harmonics_forward, harmonics_reverse
from endotsr.method.splatting.projection import Projected, ProjectionSaved, projection_forward, projection_reverse
from endotsr.method.splatting.settings import EXACT, PAPER, RasterSettings
from endotsr.port.operations.made_up import AXES, COUNT, LENS, is_near, pose, positions
from endotsr.port.operations.operation import Found, Inputs, Operation, PlainPair, Settings, Variant, split_blocks
from endotsr.port.operations.requests import camera_of, raster_dict, raster_of

Random = np.random.Generator


# ---- covariance (B2) ----


def _covariance(module: Any, inputs: Inputs, settings: Settings) -> tuple[Found, Any]:
    shape, saved = module.covariance_forward(inputs["quaternion"], inputs["log_scale"])
    return shape._asdict(), saved


def _covariance_reverse(module: Any, cotangents: Inputs, saved: Any) -> Found:
    return module.covariance_reverse(module.Shape(**cotangents), saved)._asdict()


def _covariance_inputs(rng: Random) -> dict[str, NDArray]:
    return {"quaternion": rng.normal(0, 1, (4, COUNT)) * 3.0, "log_scale": rng.normal(0, 0.7, (3, COUNT))}


# ---- projection (B3) ----


def _projection(inputs: Inputs, settings: Settings) -> tuple[Found, tuple[Projected, ProjectionSaved]]:
    shape = Shape(inputs["rotation"], inputs["scale"])
    out, saved = projection_forward(inputs["position"], shape, camera_of(inputs, settings), raster_of(settings))
    return {"mean2d": out.mean2d, "covariance2d": out.covariance2d, "depth": out.depth}, (out, saved)


def _projection_reverse(cotangents: Inputs, saved: tuple[Projected, ProjectionSaved]) -> Found:
    d_mean, d_covariance, d_depth = (cotangents[name] for name in ("mean2d", "covariance2d", "depth"))
    grads = projection_reverse(d_mean, d_covariance, d_depth, saved[1], pose_gradient=True)
    assert grads.d_camera is not None
    return {
        "d_position": grads.d_position,
        "d_rotation": grads.d_rotation,
        "d_scale": grads.d_scale,
        "d_rotation_matrix": grads.d_camera.d_rotation,
        "d_translation": grads.d_camera.d_translation,
    }


def _projection_inputs(rng: Random) -> dict[str, NDArray]:
    """Includes centres beyond the off-axis limit on all four sides and one behind the camera."""
    position = positions(rng, 12)
    shape, _ = covariance_forward(rng.normal(0, 1, (4, 12)), rng.normal(-0.5, 0.4, (3, 12)))
    camera = pose()
    seen = [(2.5, 0.1, 3.0), (-2.5, 0.1, 3.0), (0.1, 2.5, 3.0), (0.1, -2.5, 3.0), (2.5, 2.5, 3.0)]
    for k, (x, y, z) in enumerate(seen):
        position[:, k] = camera["rotation_matrix"].T @ (np.array([z * x, z * y, z]) - camera["translation"])
    position[:, 5] = camera["rotation_matrix"].T @ (np.array([0.1, 0.1, -3.0]) - camera["translation"])
    return {"position": position, "rotation": shape.rotation, "scale": shape.scale, **camera}


def _projection_variant(name: str, raster: RasterSettings) -> Variant:
    return Variant(
        f"projection_{name}",
        _projection_inputs,
        settings={"raster": raster_dict(raster), "camera": LENS},
        blocks=split_blocks({"position": AXES}),
        covers=is_near(name),
    )


# ---- harmonics (B4) ----


def _harmonics_trace(inputs: Inputs, settings: Settings, saved: HarmonicsSaved) -> dict[str, NDArray]:
    return {"clamped": saved.clamped.astype(int)}


def _harmonics_variant(degree: int) -> Variant:
    count = (degree + 1) ** 2

    def inputs(rng: Random) -> dict[str, NDArray]:
        """Colours on both sides of the clamp at zero, none near it; at degree 0 the direction has no effect."""
        made = {
            "harmonics": rng.uniform(-0.2, 0.2, (count, 3, COUNT)) / count,
            "residual": rng.uniform(-0.1, 0.1, (3, COUNT)),
            "position": rng.normal(0, 1, (3, COUNT)) + np.array([[0.0], [0.0], [4.0]]),
            "centre": rng.normal(0, 0.3, 3),
        }
        made["harmonics"][0, :, ::3] = -4.0  # clamped
        return made if degree > 0 else {name: made[name] for name in ("harmonics", "residual")}

    def still(dtype: np.dtype) -> dict[str, NDArray]:
        return {} if degree > 0 else {"position": np.zeros((3, COUNT), dtype), "centre": np.zeros(3, dtype)}

    return Variant(
        f"harmonics_degree_{degree}",
        inputs,
        settings={"degree": degree},
        fixed=still,
        blocks=split_blocks({"harmonics": {f"degree {d}": slice(d * d, (d + 1) ** 2) for d in range(degree + 1)}}),
        covers=lambda settings: settings["degree"] == degree,
    )


OPERATIONS = [
    Operation(
        name="covariance",
        equation="B2",
        text="rotation and semi-axes",
        function="endotsr.method.splatting.covariance.covariance_forward",
        forward=partial(_covariance, covariance),
        reverse=partial(_covariance_reverse, covariance),
        variants=(Variant("covariance", _covariance_inputs),),
    ),
    Operation(
        name="projection",
        equation="B3",
        text="screen mean, covariance and depth",
        function="endotsr.method.splatting.projection.projection_forward",
        forward=_projection,
        reverse=_projection_reverse,
        extra=lambda inputs, settings, saved: {"visible": saved[0].visible},
        variants=(_projection_variant("exact", EXACT), _projection_variant("paper", PAPER)),
    ),
    PlainPair(harmonics_forward, harmonics_reverse, "harmonics residual position centre degree", "colour").operation(
        "harmonics",
        "B4",
        "colour from harmonics",
        trace=_harmonics_trace,
        variants=tuple(_harmonics_variant(degree) for degree in range(4)),
    ),
]
