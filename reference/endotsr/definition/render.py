"""Equations (B2) to (B5): one view of the Gaussians at one time."""

from collections import namedtuple

import numpy as np

from endotsr.definition.compositing import composite_forward, seen
from endotsr.definition.covariance import Shape, covariance_forward, covariance_reverse
from endotsr.definition.harmonics import harmonics_forward, harmonics_reverse
from endotsr.definition.legacy import composite_reverse, projection_reverse
from endotsr.definition.projection import CameraGrads, projection_forward

# Raw parameters of N Gaussians at one time.
Scene = namedtuple("Scene", "position quaternion log_scale opacity_logit harmonics residual", defaults=[None])
RenderOut = namedtuple("RenderOut", "colour depth opacity")  # Images of one view: (3, H, W), (H, W), (H, W).
# The saved tuples of the stages.
RenderSaved = namedtuple("RenderSaved", "covariance projection harmonics composite visible")
RenderGrads = namedtuple(
    "RenderGrads",
    "d_position d_quaternion d_log_scale d_opacity_logit d_harmonics d_residual d_mean2d visible d_background d_camera",
)


def render_forward(scene, camera, settings, *, degree=3, background=None):
    """Equations (B2) to (B5): RenderOut of a Scene; background (3,) is black by default."""
    background = np.zeros(3) if background is None else background
    shape, covariance = covariance_forward(scene.quaternion, scene.log_scale)
    projected, projection = projection_forward(scene.position, shape, camera, settings)
    centre = -camera.rotation.T @ camera.translation
    colour, harmonics = harmonics_forward(scene.harmonics, scene.residual, scene.position, centre, degree)
    size = camera.width, camera.height
    out, composite = composite_forward(projected, scene.opacity_logit, colour, settings, background, *size)
    visible = seen(projected, scene.opacity_logit, settings, *size)
    return RenderOut(*out[:3]), RenderSaved(covariance, projection, harmonics, composite, visible)


def render_reverse(d_colour, d_depth, d_opacity, saved):
    """Reverse of the view, from images (3, H, W), (H, W), (H, W); the last may be None."""
    d_opacity = 0 * d_depth if d_opacity is None else d_opacity
    back = composite_reverse(d_colour, d_depth, d_opacity, saved.composite)
    harmonics = harmonics_reverse(back.d_colour, saved.harmonics)
    projection = projection_reverse(back.d_mean2d, back.d_covariance2d, back.d_depth, saved.projection)
    covariance = covariance_reverse(Shape(projection.d_rotation, projection.d_scale), saved.covariance)
    camera = saved.projection.camera
    d_centre = harmonics.d_centre  # centre = -rotation^T translation
    d_camera = CameraGrads(
        projection.d_camera.d_rotation - np.outer(camera.translation, d_centre),
        projection.d_camera.d_translation - camera.rotation @ d_centre,
    )
    return RenderGrads(
        projection.d_position + harmonics.d_position, *covariance, back.d_opacity_logit, *harmonics[:2],
        back.d_mean2d, saved.visible, back.d_background, d_camera,
    )  # fmt: skip
