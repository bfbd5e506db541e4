"""Operations of the rasteriser: its stages (B2) to (B5) alone, and the whole render.

A setting that begins with an underscore is not part of a case: `_path` chooses which of the two compositing paths of
the reference answers, which must not matter.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.golden.operation import Asked, Inputs, Operation, Settings, real_of
from endotsr.splatting import compositing
from endotsr.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.splatting.camera import Camera
from endotsr.splatting.covariance import Shape, covariance_forward, covariance_reverse
from endotsr.splatting.fast import blocks as compositing_blocks
from endotsr.splatting.harmonics import harmonics_forward, harmonics_reverse
from endotsr.splatting.projection import Projected, projection_forward, projection_reverse
from endotsr.splatting.records import gather_gradients, log_opacity, pack_records
from endotsr.splatting.render import CONIC_EPSILON, Compositor, Scene, render_forward, render_reverse
from endotsr.splatting.settings import LegacyDeviations, RasterSettings

Found = dict[str, NDArray | float | None]
PATHS: tuple[Compositor, ...] = ("definition", "blocks")


def raster_of(settings: Settings) -> RasterSettings:
    """The rasteriser settings written out in a case."""
    fields: dict[str, Any] = dict(settings["raster"])
    fields["deviations"] = LegacyDeviations(**fields["deviations"])
    return RasterSettings(**fields)


def raster_dict(raster: RasterSettings) -> dict:
    """The other way round."""
    return raster._asdict() | {"deviations": raster.deviations._asdict()}


def camera_of(inputs: Inputs, settings: Settings) -> Camera:
    """Pose from the inputs, lens from the settings."""
    return Camera(inputs["rotation_matrix"], inputs["translation"], **settings["camera"])


def compositor_of(settings: Settings) -> Compositor:
    """Which compositing path answers; both give the same up to rounding.

    `blocks` only where that path computes these settings.
    Raises: ValueError for any other name.
    """
    asked = settings.get("_compositor", "definition")
    if asked not in PATHS:
        raise ValueError(f"_path: {asked!r} is not known; allowed: {', '.join(PATHS)}")
    return "blocks" if asked == "blocks" and compositing_blocks.supports(raster_of(settings)) else "definition"


def _covariance(inputs: Inputs, settings: Settings) -> Found:
    shape, saved = covariance_forward(inputs["quaternion"], inputs["log_scale"])
    grads = covariance_reverse(Shape(inputs["d_rotation"], inputs["d_scale"]), saved)
    return {
        "rotation": shape.rotation,
        "scale": shape.scale,
        "d_quaternion": grads.quaternion,
        "d_log_scale": grads.log_scale,
    }


def _projection(inputs: Inputs, settings: Settings) -> Found:
    shape = Shape(inputs["rotation"], inputs["scale"])
    camera, raster = camera_of(inputs, settings), raster_of(settings)
    out, saved = projection_forward(inputs["position"], shape, camera, raster)
    cotangents = (inputs["d_mean2d"], inputs["d_covariance2d"], inputs["d_depth"])
    grads = projection_reverse(*cotangents, saved, pose_gradient=True)
    assert grads.camera is not None
    return {
        "visible": out.visible,
        "mean2d": out.mean2d,
        "covariance2d": out.covariance2d,
        "depth": out.depth,
        "d_position": grads.position,
        "d_rotation": grads.rotation,
        "d_scale": grads.scale,
        "d_rotation_matrix": grads.camera.rotation,
        "d_translation": grads.camera.translation,
    }


def _harmonics(inputs: Inputs, settings: Settings) -> Found:
    position, centre = inputs["position"], inputs["centre"]
    colour, saved = harmonics_forward(inputs["harmonics"], inputs["residual"], position, centre, settings["degree"])
    grads = harmonics_reverse(inputs["d_colour"], saved)
    return {
        "colour": colour,
        "d_harmonics": grads.harmonics,
        "d_residual": grads.residual,
        "d_position": grads.position,
        "d_centre": grads.centre,
    }


def composite_of(inputs: Inputs, settings: Settings):
    """Images and saved tuple of screen Gaussians, and what the gather needs."""
    raster, (width, height) = raster_of(settings), (settings["width"], settings["height"])
    a, b, c = inputs["covariance2d"]
    count = a.size
    seen = np.ones(count, bool)
    projected = Projected(inputs["mean2d"], inputs["covariance2d"], a * c - b * b, inputs["depth"], seen)
    log_alpha = log_opacity(inputs["opacity_logit"])
    box, visible = screen_boxes(projected, log_alpha, raster, width, height)
    order = depth_order(inputs["depth"], visible)
    records = pack_records(order, projected, log_alpha, inputs["colour"])
    blocks = compositor_of(settings) == "blocks"
    module = compositing_blocks if blocks else compositing
    lists = tile_lists(box, order, module.TILE_WIDTH, module.TILE_HEIGHT, width, height)
    forward = compositing_blocks.composite_blocks_forward if blocks else compositing.composite_forward
    out, saved = forward(records, lists, raster, inputs["background"], width, height)
    return out, saved, projected, order


def _composite(inputs: Inputs, settings: Settings) -> Found:
    out, saved, projected, order = composite_of(inputs, settings)
    images = (inputs["d_colour_image"], inputs["d_depth_image"], inputs["d_opacity_image"])
    if isinstance(saved, compositing_blocks.BlocksSaved):
        pairs = compositing_blocks.composite_blocks_reverse(*images, saved)
    else:
        pairs = compositing.composite_reverse(*images, saved)
    deviations = raster_of(settings).deviations
    grads = gather_gradients(
        order, saved.records, saved.lists, pairs, projected.determinant, inputs["opacity_logit"],
        conic_epsilon=CONIC_EPSILON if deviations.conic_epsilon else 0.0,
        keep_depth=not deviations.drop_depth_to_z,
    )  # fmt: skip
    return {
        "colour_image": out.colour,
        "depth_image": out.depth,
        "opacity_image": out.opacity,
        "d_mean2d": grads[0],
        "d_covariance2d": grads[1],
        "d_opacity_logit": grads[2],
        "d_colour": grads[3],
        "d_depth": grads[4],
        "d_background": compositing.background_gradient(images[0], out.transmittance),
    }


def scene_of(inputs: Inputs) -> Scene:
    """Deformed raw parameters of a request."""
    return Scene(*(inputs.get(name) for name in Scene._fields))  # type: ignore[arg-type]


def _render(inputs: Inputs, settings: Settings) -> Found:
    dtype = real_of(inputs)
    background = inputs["background"]
    out, saved = render_forward(
        scene_of(inputs), camera_of(inputs, settings), raster_of(settings),
        degree=settings["degree"], background=background, compositor=compositor_of(settings),
    )  # fmt: skip
    found: Found = {"colour_image": out.colour, "depth_image": out.depth, "opacity_image": out.opacity}
    if "d_colour_image" not in inputs:
        return found
    images = (inputs["d_colour_image"], inputs["d_depth_image"], inputs["d_opacity_image"])
    grads = render_reverse(*images, saved, background_gradient=True, pose_gradient=True)
    assert grads.camera is not None and grads.background is not None
    names = ("position", "quaternion", "log_scale", "opacity_logit", "harmonics", "residual", "mean2d", "background")
    return {
        **found,
        "visible": saved.visible,
        **{f"d_{name}": getattr(grads, name) for name in names},
        "d_rotation_matrix": grads.camera.rotation.astype(dtype),
        "d_translation": grads.camera.translation.astype(dtype),
    }


IMAGES = {
    "colour_image": ("display", "splatting_oracle.render"),
    "depth_image": ("scene unit", "splatting_oracle.render"),
    "opacity_image": ("1", "splatting_oracle.render"),
}


def _preset(settings: Settings) -> str:
    """Which of the two registered rasterisers a case is nearer to."""
    return "exact" if settings["raster"]["support"] == "everywhere" else "paper"


def _compositing_pairs(stage: str, settings: Settings) -> tuple[str, ...]:
    """The definition, and the fast path where it answers too."""
    blocks = (f"{stage}_blocks",) if compositing_blocks.supports(raster_of(settings)) else ()
    return (f"{stage}_{_preset(settings)}", *blocks)


OPERATIONS = [
    Operation("covariance", "B2", "rotation and semi-axes", _covariance, {
        "rotation": Asked(1, "1", "last", "splatting_oracle.rotation"), "scale": Asked(1, "scene unit", "last"),
        "d_quaternion": Asked(2, "loss", "last"), "d_log_scale": Asked(2, "loss", "last"),
    }, lambda s: ("covariance",)),
    Operation("projection", "B3", "screen mean, covariance and depth", _projection, {
        "visible": Asked(1, scale="exact"),
        "mean2d": Asked(1, "px", "last", "splatting_oracle.project"),
        "covariance2d": Asked(1, "px^2", "last", "splatting_oracle.project"),
        "depth": Asked(1, "scene unit", "last", "splatting_oracle.project"),
        "d_position": Asked(2, "loss per scene unit", "last"), "d_rotation": Asked(2, "loss", "last"),
        "d_scale": Asked(2, "loss per scene unit", "last"), "d_rotation_matrix": Asked(2, "loss"),
        "d_translation": Asked(2, "loss per scene unit"),
    }, lambda s: (f"projection_{_preset(s)}",)),
    Operation("harmonics", "B4", "colour from harmonics", _harmonics, {
        "colour": Asked(1, "display", oracle="splatting_oracle.colour"),
        "d_harmonics": Asked(2, "loss"), "d_residual": Asked(2, "loss"),
        "d_position": Asked(2, "loss per scene unit"), "d_centre": Asked(2, "loss per scene unit"),
    }, lambda s: (f"harmonics_degree_{s['degree']}",)),
    Operation("composite", "B5", "blend screen Gaussians", _composite, {
        **{name: Asked(1, unit, oracle="splatting_oracle.composite") for name, (unit, _) in IMAGES.items()},
        "d_mean2d": Asked(2, "loss per px", "last", "splatting_oracle.composite_reverse"),
        "d_covariance2d": Asked(2, "loss per px^2", "last", "splatting_oracle.composite_reverse"),
        "d_opacity_logit": Asked(2, "loss", "last", "splatting_oracle.composite_reverse"),
        "d_colour": Asked(2, "loss per display unit", "last", "splatting_oracle.composite_reverse"),
        "d_depth": Asked(2, "loss per scene unit", "last", "splatting_oracle.composite_reverse"),
        "d_background": Asked(2, "loss per display unit", oracle="splatting_oracle.composite_reverse"),
    }, lambda s: _compositing_pairs("composite", s)),
    Operation("render", "B5", "one view of deformed Gaussians", _render, {
        **{name: Asked(3, unit, oracle=oracle) for name, (unit, oracle) in IMAGES.items()},
        "visible": Asked(3, scale="exact"),
        "d_position": Asked(3, "loss per scene unit", "last"), "d_quaternion": Asked(3, "loss", "last"),
        "d_log_scale": Asked(3, "loss", "last"), "d_opacity_logit": Asked(3, "loss", "last"),
        "d_harmonics": Asked(3, "loss", "last"), "d_residual": Asked(3, "loss", "last"),
        "d_mean2d": Asked(3, "loss per px", "last"), "d_background": Asked(3, "loss per display unit"),
        "d_rotation_matrix": Asked(3, "loss"), "d_translation": Asked(3, "loss per scene unit"),
    }, lambda s: _compositing_pairs("render", s)),
]  # fmt: skip
