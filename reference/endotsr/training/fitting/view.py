"""One training view, equation (6), composed only of documented pairs: the passes of one iteration.

    Gaussians --(B1), (1)-(3)--> scene at t --(B2)-(B5)--> images --(B13)--> exposed --(6)--> loss,   and back
                            camera --(B16)--^

In: raw parameters, the targets of one frame, a camera and a time. Out: the loss, and gradients back to the deformed
scene (`view_pass`). Two functions continue from there. `view_gradients` computes and stores the gradient of every
array; the gradient check and the golden family `objective` call it. `training_step` gives the gradients of the deformed
scene to the optimiser, which fuses the largest reverse passes with its step (`fused/`). One such step is bitwise equal
to `view_gradients` followed by `adam_update` (tested).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.config import Config
from endotsr.method.equations.deformation import deformation_reverse
from endotsr.method.equations.matern import matern_penalty_forward, matern_penalty_reverse
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.timer import NO_TIMER, Timer
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import (
    Compositor,
    RenderGrads,
    RenderOut,
    RenderSaved,
    render_forward,
    render_reverse,
)
from endotsr.method.splatting.settings import RasterSettings
from endotsr.training.fitting.model import (
    OffsetsAhead,
    SceneSaved,
    Spectral,
    raster_settings,
    scene_at,
    scene_reverse,
    with_exposure,
    with_exposure_reverse,
    with_pose_correction,
    with_pose_correction_reverse,
)
from endotsr.training.fitting.objective import ImageLoss, LossWeights, Targets, image_loss
from endotsr.training.scene.gaussians import Gaussians
from endotsr.training.scene.parameters import Exposure, Pose


class ViewPass(NamedTuple):
    """One view, forward to the loss and back to the deformed scene."""

    loss: ImageLoss  # the loss terms on images, and their gradients
    rendered: RenderOut  # the images that were compared
    render_saved: RenderSaved  # has the decisions of the render: order, contributors, clamps
    scene_saved: SceneSaved  # of `scene_at`, for `scene_reverse`
    d_scene: RenderGrads  # gradients with respect to the deformed scene
    d_exposure: Exposure | None  # gradients with respect to the exposure of this frame
    d_pose: Pose | None  # gradients with respect to the correction of its pose
    camera: Camera  # with its correction


class ViewGradients(NamedTuple):
    """Equation (6) of one view and its derivatives."""

    loss: float  # the Matern penalty included
    terms: dict[str, float]  # unweighted; only those evaluated
    gradients: dict[str, FloatArray]  # by field of `Gaussians`, for every array that exists
    d_exposure: Exposure | None  # gradients with respect to the exposure of this frame
    d_pose: Pose | None  # gradients with respect to the correction of its pose
    rendered: RenderOut  # the images that were compared
    render_saved: RenderSaved  # has the decisions of the render: order, contributors, clamps


def view_pass(
    gaussians: Gaussians,
    spectral: Spectral,
    targets: Targets,
    weights: LossWeights,
    config: Config,
    camera: Camera,
    t: float,
    edges: NDArray[np.bool_] | None = None,
    *,
    exposure: Exposure | None = None,
    pose: Pose | None = None,
    raster: RasterSettings | None = None,
    degree: int | None = None,
    compositor: Compositor = "auto",
    ahead: OffsetsAhead | None = None,
    timer: Timer = NO_TIMER,
) -> ViewPass:
    """Loss of one view on images, and its gradients with respect to the deformed scene, exposure and pose.

    The arguments are those of `view_gradients`. No array of `gaussians` is changed.
    ahead     offsets of the FDM at t, if they are known;  timer   records the stages
    """
    raster = raster_settings(config) if raster is None else raster
    degree = config.model.harmonics_degree if degree is None else degree

    scene, scene_saved = scene_at(gaussians, spectral, config.model, t, ahead, timer)
    camera, pose_saved = with_pose_correction(camera, pose)
    rendered, render_saved = render_forward(scene, camera, raster, degree=degree, compositor=compositor, timer=timer)
    rendered, exposure_saved = with_exposure(rendered, exposure)
    loss = image_loss(rendered, targets, weights, config.loss, edges, timer=timer)

    d_colour, d_exposure = with_exposure_reverse(loss.d_colour, exposure_saved)
    moving = pose_saved is not None
    d_scene = render_reverse(d_colour, loss.d_depth, None, render_saved, pose_gradient=moving, timer=timer)
    d_pose = with_pose_correction_reverse(d_scene.d_camera, pose_saved)
    return ViewPass(loss, rendered, render_saved, scene_saved, d_scene, d_exposure, d_pose, camera)


def gaussian_gradients(d_scene: RenderGrads, saved: SceneSaved) -> dict[str, FloatArray]:
    """Gradients with respect to every array of the Gaussians, by field, from those of the deformed scene.

    d_scene   of `render_reverse`, for any function of the images
    saved     of `scene_at`
    """
    gradients, d_offsets = scene_reverse(d_scene, saved)
    if saved.deformation is not None and d_offsets is not None:
        fdm = deformation_reverse(d_offsets, saved.deformation)
        gradients |= {"fdm_weight": fdm.d_fdm_weight, "fdm_centre": fdm.d_fdm_centre, "fdm_width": fdm.d_fdm_width}
    return gradients


def view_gradients(
    gaussians: Gaussians,
    spectral: Spectral,
    targets: Targets,
    weights: LossWeights,
    config: Config,
    camera: Camera,
    t: float,
    edges: NDArray[np.bool_] | None = None,
    *,
    exposure: Exposure | None = None,
    pose: Pose | None = None,
    raster: RasterSettings | None = None,
    degree: int | None = None,
    compositor: Compositor = "auto",
) -> ViewGradients:
    """Loss and gradients of one view, equation (6), with all components that `gaussians` has.

    targets   of the observed frame, see `frame_targets`;  weights   at this iteration
    t         normalised time; any value is allowed, [0, 1] is the sequence
    edges     (H, W) bool, where the depth is not smoothed; None = Canny edges of the rendered depth
    exposure  of this frame, equation (B13); None = none
    pose      correction of the pose of `camera`, equation (B16); None = none
    raster    None = that of `config`;  degree   active harmonic degree, None = the model's

    Edges:  a term of weight 0 is not evaluated, but for L1 and the Matern penalty; a component without arrays gets no
            gradient.
    Oracle: central differences (`endotsr gradcheck objective`), golden family `objective`.
    """
    found = view_pass(
        gaussians, spectral, targets, weights, config, camera, t, edges,
        exposure=exposure, pose=pose, raster=raster, degree=degree, compositor=compositor,
    )  # fmt: skip
    loss, terms = found.loss.loss, found.loss.terms
    gradients = gaussian_gradients(found.d_scene, found.scene_saved)
    if gaussians.motion_coefficients is not None:
        penalty, penalty_saved = matern_penalty_forward(gaussians.motion_coefficients, spectral.rho)
        loss, terms = loss + config.loss.lambda_msp * penalty, terms | {"matern_penalty": penalty}
        gradients["motion_coefficients"] += matern_penalty_reverse(config.loss.lambda_msp, penalty_saved)
    images = (found.rendered, found.render_saved)
    return ViewGradients(loss, terms, gradients, found.d_exposure, found.d_pose, *images)
