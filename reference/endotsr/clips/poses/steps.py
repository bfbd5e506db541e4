"""Steps of all poses at once: sparse normal equations over pairs of frames, solved with the first pose held fixed.

A common motion of all cameras is unobservable: the first pose stays. In: pairs of frames, each with a quadratic of the
change of its relative pose in target axes, as `pair_kernels` sums it. Out: one step per pose. The direct bundle
adjustment and the pose graph share these equations. A pair may join any two frames.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.poses.pair_kernels import COST, RIGHT
from endotsr.clips.poses.views import between
from endotsr.method.equations.pose import pose_forward
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

if TYPE_CHECKING:
    from scipy.sparse import csc_array

LARGEST = 0.1  # rad, and fraction of the depth: longest step
LEAST = 1e-3  # of sums over the points of a picture
UPPER = np.triu_indices(6)


def moved(pose: CameraPose, step: FloatArray) -> CameraPose:
    """The pose after a step (6,) of equation (B16)."""
    rotation, translation, _ = pose_forward(*pose, step[:3], step[3:])
    return CameraPose(rotation, translation)


def solved_step(
    sums: FloatArray, pairs: NDArray[np.intp], poses: list[CameraPose], depth: float, damping: float,
    least: float = LEAST,
) -> FloatArray:  # fmt: skip
    """(n, 6) rotation vectors and offsets; those of the first frame are 0, and so are those of a frame without a pair.

    sums     (P, at least 27) upper triangle and right side of every pair (P, 2)
    depth    scene units: the unit of a translation
    damping  fraction of the diagonal that is added to it
    least    is added to the diagonal too, in units of `sums`; what the pairs leave undetermined stays small
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    unit = np.array([1, 1, 1, depth, depth, depth])
    matrix, right = normal_equations(sums, pairs, poses, unit)
    diagonal = matrix.diagonal()
    damped = (matrix + diags_array(diagonal * damping + np.where(diagonal > 0, least, 1.0))).tocsc()
    kept = damped[6:, 6:]  # the first frame stays
    # The matrix is symmetric and positive definite: the pivots are taken from its diagonal.
    factors = splu(kept, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    step = np.concatenate([np.zeros(6), -factors.solve(right[6:])]).reshape(len(poses), 6)
    longest = np.abs(step).max()
    return step * min(1.0, LARGEST / longest if longest > 0 else 1.0) * unit


def normal_equations(
    sums: FloatArray, pairs: NDArray[np.intp], poses: list[CameraPose], unit: FloatArray
) -> tuple["csc_array", FloatArray]:
    """The matrix (6 n, 6 n) and the right side (6 n,) of all poses, in the units (6,) of a step."""
    from scipy.sparse import csc_array

    right = np.zeros((len(poses), 6))
    blocks, places = np.empty((len(pairs), 4, 6, 6)), np.empty((len(pairs), 4, 2), np.intp)
    for k, ((source, target), part) in enumerate(zip(pairs, sums)):
        matrix = np.zeros((6, 6))
        matrix[UPPER] = part[:RIGHT]
        matrix = (matrix + np.triu(matrix, 1).T) * unit[:, None] * unit
        turned = adjoint(between(poses, source, target)) * unit / unit[:, None]
        mixed = matrix @ turned
        blocks[k] = matrix, turned.T @ mixed, -mixed, -mixed.T
        places[k] = (target, target), (source, source), (target, source), (source, target)
        g = part[RIGHT:COST] * unit
        right[target] += g
        right[source] -= turned.T @ g
    row = 6 * places[..., 0, None, None] + np.arange(6)[:, None] + np.zeros(6, np.intp)
    column = 6 * places[..., 1, None, None] + np.arange(6) + np.zeros((6, 1), np.intp)
    size = 6 * len(poses)
    return csc_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=(size, size)), right.ravel()


def adjoint(pose: CameraPose) -> FloatArray:
    """(6, 6): the change of a relative pose by a change (omega, tau) of its source, in target axes.

    For small changes, T Exp(xi) T^-1 = Exp(adjoint(T) xi).
    """
    r, (x, y, z) = pose
    found = np.zeros((6, 6))
    found[:3, :3] = found[3:, 3:] = r
    found[3:, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ r  # (22.6)
    return found
