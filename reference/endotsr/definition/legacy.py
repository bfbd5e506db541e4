"""The four deviations of the released CUDA program, as changes of the reverse passes of (B3) and (B5).

`compositing` and `projection` are the equations. The functions of the same names here add the deviations that
`settings.deviations` names; without any, they return what the equations return. Specification: *Presets of the
rasteriser*, preset `legacy`.
"""

import numpy as np

from endotsr.definition import compositing, projection
from endotsr.definition.projection import covariance_reverse_parts, jacobian

CONIC_EPSILON = 1e-7  # px^4


def composite_reverse(d_colour, d_depth, d_opacity, saved):
    """Reverse of (B5) with up to three deviations.

    pass_clamped_alpha  the clamp at alpha_max passes its gradient on
    drop_depth_to_z     the depth image has no gradient with respect to z
    conic_epsilon       1 / (det^2 + 1e-7) takes the place of 1 / det^2 in the gradient of the covariance
    """
    deviations = saved.settings.deviations
    if deviations.pass_clamped_alpha:
        saved = saved._replace(settings=saved.settings._replace(alpha_max=np.inf))
    out = compositing.composite_reverse(d_colour, d_depth, d_opacity, saved)
    if deviations.drop_depth_to_z:
        out = out._replace(d_depth=0 * out.d_depth)
    if deviations.conic_epsilon:
        square = saved.projected.determinant**2
        out = out._replace(d_covariance2d=out.d_covariance2d * (square / (square + CONIC_EPSILON)))
    return out


def projection_reverse(d_mean2d, d_covariance2d, d_depth, saved):
    """Reverse of (B3); double_clamp_term counts the share of z in J_02 and J_12 twice where the slope is clamped."""
    out = projection.projection_reverse(d_mean2d, d_covariance2d, d_depth, saved)
    if not saved.settings.deviations.double_clamp_term:
        return out
    position, _, camera, settings, visible = saved
    w = camera.rotation
    point = np.where(visible, w @ position + camera.translation[:, None], 1)
    _, slope, free = jacobian(point, camera, settings)
    _, g_t = covariance_reverse_parts(np.where(visible, d_covariance2d, 0), saved, point)
    g_j = np.einsum("ikn,jk->ijn", g_t, w)
    focal = np.array([[camera.fx], [camera.fy]])
    g_slope = -focal / point[2] * np.array([g_j[0, 2], g_j[1, 2]])  # (7.6)
    again = -(np.where(free, 0, g_slope * slope) / point[2]).sum(axis=0)
    g_point = np.stack([0 * again, 0 * again, again])
    d_rotation = out.d_camera.d_rotation + g_point @ np.where(visible, position, 0).T
    d_translation = out.d_camera.d_translation + g_point.sum(axis=1)
    d_camera = out.d_camera._replace(d_rotation=d_rotation, d_translation=d_translation)
    return out._replace(d_position=out.d_position + w.T @ g_point, d_camera=d_camera)
