"""The fitted Gaussians, as a structure of arrays. The Gaussian index is the LAST axis of every array.

With this layout, every hot loop runs over contiguous memory. One rule, a gather along the last axis, clones, splits,
prunes and permutes every array and its optimiser moments.
"""

from typing import NamedTuple

from endotsr.method.kernels.arrays import FloatArray

POSITION_CHANNELS = slice(0, 3)  # of the ten deformation channels
QUATERNION_CHANNELS = slice(3, 7)
LOG_SCALE_CHANNELS = slice(7, 10)
DEFORMATION_CHANNELS = 10


class Gaussians(NamedTuple):
    """Raw (pre-activation) parameters of N Gaussians. Arrays of a disabled component are None."""

    position: FloatArray  # (3, N)  canonical centre mu, scene units
    quaternion: FloatArray  # (4, N)  w, x, y, z; normalised in the forward pass
    log_scale: FloatArray  # (3, N)  natural log of the semi-axes, scene units
    opacity_logit: FloatArray  # (N,)
    harmonics: FloatArray  # (K, 3, N)  K = (degree + 1)^2; [coefficient, channel, Gaussian]
    fdm_weight: FloatArray | None = None  # (10, B, N)  w of the flexible deformation model
    fdm_centre: FloatArray | None = None  # (10, B, N)  theta, normalised time
    fdm_width: FloatArray | None = None  # (10, B, N)  sigma, normalised time
    appearance_coefficients: FloatArray | None = None  # (3, 2F, N)  A of equation (2)
    motion_coefficients: FloatArray | None = None  # (3, 2F, N)  C of equation (3), scene units

    @property
    def count(self) -> int:
        """Number of Gaussians N."""
        return self.position.shape[-1]


def arrays(gaussians: Gaussians) -> dict[str, FloatArray]:
    """The arrays that exist, by field name, in field order."""
    return {name: a for name, a in gaussians._asdict().items() if a is not None}
