"""Initial translation residual from tracked motion (B15): Gaussians follow the tissue from the first iteration.

For a point with positions X(t_i) at the training times, canonical position mu and coefficients C solve

    min  sum_i a_i |mu + C phi(t_i) - X(t_i)|^2 + sum_f (RIDGE rho_f + LEAST_RIDGE) |C_f|^2

with the atoms phi of equation (1) and the Matern weights rho of equation (4). The weight a_i is 1 if the point is
tracked, and UNFOLLOWED if its position is interpolated from the surrounding points.

The atoms are fixed functions of time. The FDM does not take this motion: its centres and widths are learned, and with
large weights one optimiser step of a centre can move a Gaussian by a pixel.

In: Gaussians and their tracks. Out: the Gaussians with new positions and motion coefficients.
"""

import numpy as np
from numpy.typing import NDArray

from endotsr.method.equations.dictionary import dictionary_forward
from endotsr.method.kernels.arrays import FloatArray
from endotsr.training.scene.gaussians import Gaussians

RIDGE = 30.0  # of the sum of squared residuals over the training times; rho has mean 1
LEAST_RIDGE = 0.1  # for the lowest frequencies, whose rho is nearly 0
UNFOLLOWED = 0.1
POINTS_AT_ONCE = 4096


def with_tracked_motion(
    gaussians: Gaussians,
    times: FloatArray,
    position: FloatArray,
    followed: NDArray[np.bool_],
    omega: FloatArray,
    rho: FloatArray,
) -> Gaussians:
    """The Gaussians with the canonical positions and motion coefficients of their tracks.

    times      (n,) normalised times of the training frames
    position   (n, 3, N) scene units; followed (n, N)
    omega      (F,) frequencies, cycles per sequence; rho (F,) their Matern weights

    Edges:  a static point has coefficients 0 and keeps its position, both to rounding.
    """
    atoms = np.stack([dictionary_forward(float(t), omega)[0] for t in times])
    design = np.concatenate([np.ones((len(times), 1)), atoms], axis=1)  # (n, 1 + 2F)
    ridge = np.diag([0.0, *np.tile(RIDGE * rho + LEAST_RIDGE, 2)])  # (19.8), (19.9)
    centre = gaussians.position.copy()
    coefficients = np.zeros((3, atoms.shape[1], gaussians.count), centre.dtype)
    for first in range(0, gaussians.count, POINTS_AT_ONCE):
        chosen = slice(first, first + POINTS_AT_ONCE)
        trust = np.where(followed[:, chosen], 1.0, UNFOLLOWED)
        normal = np.einsum("na,nb,np->pab", design, design, trust, optimize=True) + ridge
        right = np.einsum("na,np,ndp->pad", design, trust, position[:, :, chosen], optimize=True)
        solved = np.linalg.solve(normal, right)  # (19.7); (P, 1 + 2F, 3)
        centre[:, chosen] = solved[:, 0].T
        coefficients[:, :, chosen] = solved[:, 1:].transpose(2, 1, 0)
    return gaussians._replace(position=centre, motion_coefficients=coefficients)
