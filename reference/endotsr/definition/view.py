"""One training view, equation (6), composed of forward and reverse pairs: the twin of `endotsr.training.fitting.view`.

Gaussians --(B1), (1)-(3)--> scene at t --(B2)-(B5)--> images --(B13)--> exposed --(6)--> loss,   and back
                        camera --(B16)--^
"""

from collections import namedtuple

from endotsr.definition.exposure import exposure_forward, exposure_reverse
from endotsr.definition.matern import matern_penalty_forward, matern_penalty_reverse
from endotsr.definition.objective import image_loss, no_edges
from endotsr.definition.pose import pose_forward, pose_reverse
from endotsr.definition.render import render_forward, render_reverse
from endotsr.definition.scene import scene_at, scene_reverse
from endotsr.definition.settings import PAPER

ViewGradients = namedtuple("ViewGradients", "loss terms gradients d_exposure d_pose rendered visible d_mean2d")


def view_gradients(gaussians, spectral, targets, weights, config, camera, t, edges=no_edges,
                   *, exposure=None, pose=None, raster=PAPER, degree=3):  # fmt: skip
    """Loss and gradients by name; also of exposure (log_gain, bias) and pose (rotation vector, offset) if given."""
    scene, scene_saved = scene_at(gaussians, spectral, config.model, t)
    d_exposure = d_pose = exposure_saved = pose_saved = None
    if pose is not None:
        rotation, translation, pose_saved = pose_forward(camera.rotation, camera.translation, *pose)
        camera = camera._replace(rotation=rotation, translation=translation)
    rendered, render_saved = render_forward(scene, camera, raster, degree=degree)
    if exposure is not None:
        colour, exposure_saved = exposure_forward(rendered.colour, *exposure)
        rendered = rendered._replace(colour=colour)
    loss, terms, d_colour, d_depth = image_loss(rendered, targets, weights, config.loss, edges)

    if exposure_saved is not None:
        d_colour, *d_exposure = exposure_reverse(d_colour, exposure_saved)
    d_scene = render_reverse(d_colour, d_depth, None, render_saved)
    if pose_saved is not None:
        d_pose = pose_reverse(*d_scene.d_camera, saved=pose_saved)[2:]
    gradients = scene_reverse(d_scene, scene_saved)
    loss = loss + penalties(gaussians, spectral, config.loss, terms, gradients)
    return ViewGradients(loss, terms, gradients, d_exposure, d_pose, rendered, d_scene.visible, d_scene.d_mean2d)


def penalties(gaussians, spectral, config, terms, gradients):
    """Weighted sum of the terms on parameters; adds the terms and their gradients to those of the images."""
    loss = 0.0
    if gaussians.motion_coefficients is not None:
        terms["matern_penalty"], saved = matern_penalty_forward(gaussians.motion_coefficients, spectral.rho)
        loss = loss + config.lambda_msp * terms["matern_penalty"]
        gradients["motion_coefficients"] += matern_penalty_reverse(config.lambda_msp, saved)
    return loss
