"""One view of the Gaussians at one time: all splatting stages composed, forward and reverse.

In: deformed raw parameters and a camera. Out: colour, depth, opacity and, in reverse, gradients with respect to every
parameter and, on request, the background and the camera pose. This module does not depend on time.
"""

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.timer import NO_TIMER, Timer
from endotsr.method.splatting import compositing
from endotsr.method.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.method.splatting.camera import Camera, CameraGrads, camera_centre
from endotsr.method.splatting.covariance import CovarianceSaved, Shape, covariance_forward, covariance_reverse
from endotsr.method.splatting.fast import blocks as compositing_blocks
from endotsr.method.splatting.harmonics import HarmonicsSaved, harmonics_forward, harmonics_reverse
from endotsr.method.splatting.projection import (
    Projected,
    ProjectionSaved,
    projection_forward,
    projection_reverse_footprint,
)
from endotsr.method.splatting.records import gather_footprint_gradients, log_opacity, pack_records
from endotsr.method.splatting.settings import RasterSettings

CONIC_EPSILON = 1e-7  # of the CUDA rasterisers, added to det^2; used by the deviation `conic_epsilon` only

Compositor = Literal["auto", "definition", "blocks"]


class Scene(NamedTuple):
    """Deformed, raw (pre-activation) parameters of N Gaussians at one time."""

    position: FloatArray  # (3, N) scene units
    quaternion: FloatArray  # (4, N)
    log_scale: FloatArray  # (3, N)
    opacity_logit: FloatArray  # (N,)
    harmonics: FloatArray  # (K, 3, N)
    residual: FloatArray | None = None  # (3, N) added to the degree-0 coefficient, equation (2)


class RenderOut(NamedTuple):
    """Images of one view."""

    colour: FloatArray  # (3, H, W)
    depth: FloatArray  # (H, W) scene units, not normalised
    opacity: FloatArray  # (H, W)


class RenderSaved(NamedTuple):
    """The saved tuples of the stages."""

    scene: Scene
    settings: RasterSettings
    camera: Camera
    covariance: CovarianceSaved
    projection: ProjectionSaved
    harmonics: HarmonicsSaved
    projected: Projected
    order: NDArray[np.int32]
    visible: NDArray[np.bool_]
    composite: compositing.CompositeSaved | compositing_blocks.BlocksSaved


class RenderGrads(NamedTuple):
    """Gradients of one view; `d_background` and `d_camera` are None unless requested."""

    d_position: FloatArray
    d_quaternion: FloatArray
    d_log_scale: FloatArray
    d_opacity_logit: FloatArray
    d_harmonics: FloatArray
    d_residual: FloatArray | None
    d_mean2d: FloatArray  # (2, N) dL/d(u, v) per px, for density control
    visible: NDArray[np.bool_]  # (N,) the box contains a pixel of the image
    d_background: FloatArray | None
    d_camera: CameraGrads | None


def check_finite(arrays: Mapping[str, FloatArray | None]) -> None:
    """Check before any kernel that all numbers are finite. Raises: ValueError with array and index."""
    for name, array in arrays.items():
        if array is None or np.isfinite(array).all():
            continue
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}[{', '.join(map(str, index))}] is {array[index]}: finite numbers expected")


def check_scene(scene: Scene) -> None:
    """As `check_finite`, for every array of a scene."""
    check_finite(scene._asdict())


def choose_compositor(settings: RasterSettings, compositor: Compositor) -> Compositor:
    """Resolve `auto`: the fast path if it supports the settings. Raises: ValueError for `blocks` if it does not."""
    if compositor == "auto":
        return "blocks" if compositing_blocks.supports(settings) else "definition"
    if compositor == "blocks" and not compositing_blocks.supports(settings):
        raise ValueError(
            "compositor 'blocks' needs support 'ellipse', alpha_cutoff > 0, alpha_max < 1 and no pass_clamped_alpha;"
            " use 'definition'"
        )
    return compositor


def render_forward(
    scene: Scene,
    camera: Camera,
    settings: RasterSettings,
    *,
    degree: int = 3,
    background: FloatArray | None = None,
    compositor: Compositor = "auto",
    timer: Timer = NO_TIMER,
) -> tuple[RenderOut, RenderSaved]:
    """Render one view (specification B2-B5).

    scene       raw parameters, N >= 0 Gaussians
    settings    a preset of `settings.PRESETS`, or other values of its fields
    degree      active degree of the harmonics, 0..3
    background  (3,) colour, default black
    timer       measures the stages "projection" (B2-B4), "binning" and "blend forward"
    returns     RenderOut in the dtype of scene.position

    Reverse: `render_reverse`.
    Edges:   N = 0 or nothing visible gives the background and zero depth.
    Oracle:  `endotsr.definition.render`.
    """
    width, height = camera.width, camera.height
    back = np.ascontiguousarray(np.zeros(3) if background is None else background, scene.position.dtype)
    (tile_width, tile_height), composite = _forward_compositor(settings, compositor)
    with timer.stage("projection"):
        shape, covariance_saved = covariance_forward(scene.quaternion, scene.log_scale)
        projected, projection_saved = projection_forward(scene.position, shape, camera, settings)
        colour, harmonics_saved = harmonics_forward(
            scene.harmonics, scene.residual, scene.position, camera_centre(camera), degree
        )
    with timer.stage("binning"):
        log_alpha = log_opacity(scene.opacity_logit)
        box, visible = screen_boxes(projected, log_alpha, settings, width, height)
        order = depth_order(projected.depth, visible)
        records = pack_records(order, projected, log_alpha, colour)
        lists = tile_lists(box, order, tile_width, tile_height, width, height)
    with timer.stage("blend forward"):
        out, saved = composite(records, lists, settings, back, width, height)
    stages = (covariance_saved, projection_saved, harmonics_saved, projected, order, visible, saved)
    return RenderOut(out.colour, out.depth, out.opacity), RenderSaved(scene, settings, camera, *stages)


def render_reverse(
    d_colour: FloatArray,
    d_depth: FloatArray,
    d_opacity: FloatArray | None,
    saved: RenderSaved,
    *,
    background_gradient: bool = False,
    pose_gradient: bool = False,
    timer: Timer = NO_TIMER,
) -> RenderGrads:
    """Gradients of a loss with respect to every input of the view.

    d_colour   (3, H, W), d_depth (H, W), d_opacity (H, W) or None = zero
    timer      measures the stages "blend reverse", "binning" and "projection"
    """
    composite = saved.composite
    with timer.stage("blend reverse"):
        pairs = _composite_reverse(d_colour, d_depth, d_opacity, composite)
    with timer.stage("binning"):
        d_mean2d, d_footprint, d_logit, d_rgb, d_z = _gather(pairs, saved)
    with timer.stage("projection"):
        harmonics = harmonics_reverse(d_rgb, saved.harmonics)
        projection = projection_reverse_footprint(
            d_mean2d, d_footprint, d_z, saved.projection, pose_gradient=pose_gradient
        )
        covariance = covariance_reverse(Shape(projection.d_rotation, projection.d_scale), saved.covariance)
    return RenderGrads(
        d_position=projection.d_position + harmonics.d_position,
        d_quaternion=covariance.d_quaternion,
        d_log_scale=covariance.d_log_scale,
        d_opacity_logit=d_logit,
        d_harmonics=harmonics.d_harmonics,
        d_residual=harmonics.d_residual,
        d_mean2d=d_mean2d,
        visible=saved.visible,
        d_background=compositing.background_gradient(d_colour, composite.out.transmittance)
        if background_gradient
        else None,
        d_camera=_pose_gradient(projection.d_camera, harmonics.d_centre, saved.camera) if pose_gradient else None,
    )


def _forward_compositor(settings: RasterSettings, compositor: Compositor) -> tuple[tuple[int, int], Callable]:
    """Tile width and height in pixels, and the forward pass of the chosen compositor."""
    if choose_compositor(settings, compositor) == "blocks":
        tile = compositing_blocks.TILE_WIDTH, compositing_blocks.TILE_HEIGHT
        return tile, compositing_blocks.composite_blocks_forward
    return (compositing.TILE_WIDTH, compositing.TILE_HEIGHT), compositing.composite_forward


def _composite_reverse(
    d_colour: FloatArray,
    d_depth: FloatArray,
    d_opacity: FloatArray | None,
    saved: compositing.CompositeSaved | compositing_blocks.BlocksSaved,
) -> FloatArray:
    """Gradients of every pair, by the reverse pass of the compositor of `saved`."""
    if isinstance(saved, compositing_blocks.BlocksSaved):
        return compositing_blocks.composite_blocks_reverse(d_colour, d_depth, d_opacity, saved)
    d_opacity = np.zeros_like(d_depth) if d_opacity is None else d_opacity
    return compositing.composite_reverse(d_colour, d_depth, d_opacity, saved)


def _gather(pairs: FloatArray, saved: RenderSaved) -> tuple[FloatArray, ...]:
    """Sums of the pair gradients per Gaussian, with respect to mean, footprint, opacity logit, colour and depth."""
    composite, deviations = saved.composite, saved.settings.deviations
    return gather_footprint_gradients(
        saved.order, composite.records, composite.lists, pairs, saved.projected.determinant, saved.scene.opacity_logit,
        conic_epsilon=CONIC_EPSILON if deviations.conic_epsilon else 0.0,
        keep_depth=not deviations.drop_depth_to_z,
    )  # fmt: skip


def _pose_gradient(projection: CameraGrads | None, d_centre: FloatArray, camera: Camera) -> CameraGrads:
    """Add the pose gradient through the view direction: centre = -rotation^T translation."""
    assert projection is not None
    translation = np.asarray(camera.translation, d_centre.dtype)
    rotation = np.asarray(camera.rotation, d_centre.dtype)
    return CameraGrads(
        projection.d_rotation - np.outer(translation, d_centre), projection.d_translation - rotation @ d_centre
    )
