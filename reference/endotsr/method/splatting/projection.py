"""Perspective (EWA) projection of Gaussians: screen mean, 2-D covariance and its determinant, view depth (B3).

With T = J W R (J the Jacobian of the projection at the centre, W the camera rotation) and S the semi-axes,
the screen covariance is (T S)(T S)^T + low_pass I = [[a, b], [b, c]]. Its determinant is computed as a sum of
non-negative terms, low_pass^2 + low_pass |T S|^2 + sum_{k<l} (s_k s_l (t_k x t_l))^2, because a c - b^2 can
lose every digit for a needle seen at an angle.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.sums import sum_columns
from endotsr.method.kernels.threads import parallel_for
from endotsr.method.splatting.camera import Camera, CameraGrads
from endotsr.method.splatting.camera_model import Pinhole, intrinsics_of
from endotsr.method.splatting.covariance import Shape
from endotsr.method.splatting.projection_formulas import Rules, WorldToCamera
from endotsr.method.splatting.projection_kernels import (
    WITH_POSE,
    WITHOUT_POSE,
    ScreenGrads,
    project_kernel,
    project_reverse_kernel,
)
from endotsr.method.splatting.settings import RasterSettings

POSES_PER_SUM = 256  # Gaussians per partial sum of the pose gradient

# px. A projected semi-axis with a larger |du| + |dv| is clipped, with zero gradient: its square and the determinant
# stay finite. A Gaussian with a larger |u| or |v| is not drawn.
AXIS_LIMIT = {np.dtype(np.float32): 1e8, np.dtype(np.float64): 1e60}


class Projected(NamedTuple):
    """Gaussians on the screen. Entries of invisible Gaussians are zero."""

    mean2d: FloatArray  # (2, N) px
    covariance2d: FloatArray  # (3, N) a, b, c in px^2, low-pass included
    determinant: FloatArray  # (N,) a c - b^2 in px^4, formed without cancellation
    depth: FloatArray  # (N,) view-space z, scene units
    visible: NDArray[np.bool_]  # (N,) z > near, centre within the axis limit, all entries finite


class ProjectionSaved(NamedTuple):
    """Inputs and outputs of the forward pass."""

    position: FloatArray
    shape: Shape
    camera: Camera
    lens: Pinhole
    pose: WorldToCamera
    rules: Rules
    projected: Projected


def footprint(projected: Projected) -> FloatArray:
    """A = c/det, m = b/c, r = 1/c (3, N): the exponent is -(r dy^2 + A (dx - m dy)^2)/2; zero where not visible."""
    seen = projected.visible
    b, c = projected.covariance2d[1, seen], projected.covariance2d[2, seen]
    out = np.zeros_like(projected.covariance2d)
    out[:, seen] = c / projected.determinant[seen], b / c, 1 / c
    return out


class ProjectionGrads(NamedTuple):
    """Gradients of the projection. `d_camera` is None unless requested."""

    d_position: FloatArray  # (3, N)
    d_rotation: FloatArray  # (3, 3, N)
    d_scale: FloatArray  # (3, N)
    d_camera: CameraGrads | None


def projection_forward(
    position: FloatArray, shape: Shape, camera: Camera, settings: RasterSettings
) -> tuple[Projected, ProjectionSaved]:
    """Project N Gaussians to the screen (specification B3).

    position  (3, N) world centre, scene units
    shape     factored covariance, `covariance_forward`
    camera    OpenCV axes, world-to-camera
    settings  low_pass (px^2), near (scene units), jacobian_clamp (x tan(fov/2))
    returns   Projected; Gaussians with z <= near are invisible and all their entries are zero

    Reverse: `projection_reverse`, through the mean, the Jacobian, the rotation and the pose.
    Edges:   a projected semi-axis above 1e8 px (float32; 1e60 in float64), measured as |du| + |dv|, is clipped with
             zero gradient. A Gaussian with |u| or |v| above this limit or with a non-finite number is invisible.
    Oracle:  `endotsr.definition.projection`; determinant against mpmath.
    """
    dtype = position.dtype
    n = position.shape[1]
    real, rotation = dtype.type, shape.rotation.reshape(9, n)
    lens = intrinsics_of(camera, settings, dtype)
    pose = WorldToCamera(tuple(camera.rotation.astype(dtype).flat), tuple(camera.translation.astype(dtype)))
    rules = Rules(real(settings.low_pass), real(settings.near), real(AXIS_LIMIT[dtype]))
    results, visible = np.empty((7, n), dtype), np.empty(n, np.bool_)
    parallel_for(project_kernel, n, position, rotation, shape.scale, lens, pose, rules, results, visible)
    out = Projected(results[:2], results[2:5], results[5], results[6], visible)
    return out, ProjectionSaved(position, shape, camera, lens, pose, rules, out)


def projection_reverse(
    d_mean2d: FloatArray,
    d_covariance2d: FloatArray,
    d_depth: FloatArray,
    saved: ProjectionSaved,
    *,
    pose_gradient: bool = False,
) -> ProjectionGrads:
    """Gradients with respect to position, rotation, scale and, on request, the camera pose.

    d_mean2d        (2, N) dL/d(u, v), per px
    d_covariance2d  (3, N) dL/d(a, b, c), b counted once; includes the path through det = a c - b^2
    d_depth         (N,)   dL/dz through the depth image
    """
    seen = saved.projected.visible
    precision, slope, inverse_c = footprint(saved.projected)[:, seen]
    g_a, g_b, g_c = d_covariance2d[:, seen]
    d_footprint = np.zeros_like(d_covariance2d)  # of a = 1/A + m^2/r, b = m/r, c = 1/r
    d_footprint[0, seen] = -g_a / (precision * precision)
    d_footprint[1, seen] = (2 * slope * g_a + g_b) / inverse_c
    d_footprint[2, seen] = -(slope * slope * g_a + slope * g_b + g_c) / (inverse_c * inverse_c)
    return projection_reverse_footprint(d_mean2d, d_footprint, d_depth, saved, pose_gradient=pose_gradient)


def projection_reverse_footprint(
    d_mean2d: FloatArray,
    d_footprint: FloatArray,
    d_depth: FloatArray,
    saved: ProjectionSaved,
    *,
    pose_gradient: bool = False,
) -> ProjectionGrads:
    """As `projection_reverse`, from the gradients (3, N) with respect to A, m, r of `footprint`.

    The render uses this function: gradients of a, b, c lose the length of a needle, by (length / width)^2 roundings.
    """
    n, dtype = saved.position.shape[1], saved.position.dtype
    d_out = np.empty((WITH_POSE if pose_gradient else WITHOUT_POSE, n), dtype)
    parallel_for(
        project_reverse_kernel, n,
        saved.position, saved.shape.rotation.reshape(9, n), saved.shape.scale, saved.lens, saved.pose, saved.rules,
        saved.projected.visible, saved.projected.determinant, ScreenGrads(d_mean2d, d_footprint, d_depth), d_out,
    )  # fmt: skip
    d_camera = None
    if pose_gradient:
        d_pose = sum_columns(d_out[WITHOUT_POSE:], POSES_PER_SUM)
        d_camera = CameraGrads(d_pose[:9].reshape(3, 3), d_pose[9:])
    return ProjectionGrads(d_out[:3], d_out[6:WITHOUT_POSE].reshape(3, 3, n), d_out[3:6], d_camera)
