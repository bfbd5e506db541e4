"""The camera model: where a point in camera axes falls on the screen, and the Jacobian there (B3).

Apart from the pose, the projection depends on the camera only through this pair. Another model can replace it: its
forward pass returns (u, v) and the 2x3 Jacobian, its reverse propagates the gradients of both, and `intrinsics_of`
returns its parameters. `camera.backproject` is the inverse of the same model; `camera.scale_camera` changes its
resolution.
"""

from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.jit import jit_formula
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.settings import RasterSettings


class Pinhole(NamedTuple):
    """Parameters of the pinhole model, all in the dtype of the Gaussians."""

    fx: float  # px
    fy: float
    cx: float  # px from the left edge of column 0
    cy: float
    limit_x: float  # L_x: the Jacobian is evaluated at |x/z| <= L_x; infinite: no clamp
    limit_y: float
    clamp_factor: float  # of the clamped term of dJ/dz: 1; 2 in `legacy`


def intrinsics_of(camera: Camera, settings: RasterSettings, dtype: np.dtype) -> Pinhole:
    """The parameters of `pinhole` for a camera."""
    clamp, real = settings.jacobian_clamp, np.dtype(dtype).type
    return Pinhole(
        real(camera.fx),
        real(camera.fy),
        real(camera.cx),
        real(camera.cy),
        real(clamp * camera.width / (2 * camera.fx) if clamp > 0 else np.inf),
        real(clamp * camera.height / (2 * camera.fy) if clamp > 0 else np.inf),
        real(2 if settings.deviations.double_clamp_term else 1),
    )


@jit_formula
def pinhole(x, y, z, lens):
    """(u, v) in px of a point in camera axes, z > 0, and J = d(u, v)/d(x, y, z) row by row, with its off-axis clamp."""
    one, zero = type(z)(1), type(z)(0)
    inverse_z = one / z
    slope_x, slope_y = x * inverse_z, y * inverse_z
    u, v = lens.fx * slope_x + lens.cx, lens.fy * slope_y + lens.cy
    slope_x = min(max(slope_x, -lens.limit_x), lens.limit_x)
    slope_y = min(max(slope_y, -lens.limit_y), lens.limit_y)
    j00, j02 = lens.fx * inverse_z, -lens.fx * slope_x * inverse_z
    j11, j12 = lens.fy * inverse_z, -lens.fy * slope_y * inverse_z
    return u, v, (j00, zero, j02, zero, j11, j12)


@jit_formula
def pinhole_reverse(x, y, z, lens, d_u, d_v, d_z, d_jacobian):
    """Gradient of (x, y, z), from the gradients of u, v, J and, through the depth image, z."""
    one, two, zero = type(z)(1), type(z)(2), type(z)(0)
    d_j00, _, d_j02, _, d_j11, d_j12 = d_jacobian
    inverse_z = one / z
    inverse_z2 = inverse_z * inverse_z
    raw_x, raw_y = x * inverse_z, y * inverse_z
    slope_x = min(max(raw_x, -lens.limit_x), lens.limit_x)
    slope_y = min(max(raw_y, -lens.limit_y), lens.limit_y)
    # J02 = -fx clip(x/z) / z varies as x/z^2 if unclamped, as 1/z if clamped
    free_x, free_y = abs(raw_x) <= lens.limit_x, abs(raw_y) <= lens.limit_y
    power_x = two if free_x else lens.clamp_factor
    power_y = two if free_y else lens.clamp_factor
    through_x = lens.fx * (power_x * slope_x * d_j02 - d_j00)
    through_y = lens.fy * (power_y * slope_y * d_j12 - d_j11)
    d_x = -lens.fx * inverse_z2 * d_j02 if free_x else zero
    d_y = -lens.fy * inverse_z2 * d_j12 if free_y else zero
    d_slope_x, d_slope_y = d_u * lens.fx * inverse_z, d_v * lens.fy * inverse_z
    d_z = inverse_z2 * (through_x + through_y) + d_z
    return d_x + d_slope_x, d_y + d_slope_y, d_z - (d_slope_x * raw_x + d_slope_y * raw_y)
