"""Equation (B16): a correction of the camera pose of one frame, a rotation and a translation in camera axes.

In: the pose from the sequence and the parameters of its frame. Out: the pose used to render the frame. Poses from
robots and trackers can be wrong by some pixels; without this correction the model can fit the error as scene motion.
The six numbers per frame are processed in float64. This module depends on neither frame number nor time.
"""

from math import factorial
from typing import NamedTuple

import numpy as np

from endotsr.method.kernels.arrays import FloatArray

SMALL = 1.0  # rad^2; below it, the closed forms lose digits and ten terms of the series are exact to rounding
_SIGNS = [(-1.0) ** k for k in range(10)]
# of f = sin r / r, g = (1 - cos r) / r^2, f' / r and g' / r; powers of r^2, constant first
SERIES = (
    [sign / factorial(2 * k + 1) for k, sign in enumerate(_SIGNS)],
    [sign / factorial(2 * k + 2) for k, sign in enumerate(_SIGNS)],
    [-sign * (2 * k + 2) / factorial(2 * k + 3) for k, sign in enumerate(_SIGNS)],
    [-sign * (2 * k + 2) / factorial(2 * k + 4) for k, sign in enumerate(_SIGNS)],
)
# cross-product matrices of the unit vectors: CROSS[i] @ x = e_i x x
CROSS = np.array(
    [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]],
    np.float64,
)


class PoseSaved(NamedTuple):
    """The input pose, and the rotation vector with its exponential."""

    rotation: FloatArray  # (3, 3) float64
    translation: FloatArray  # (3,) float64
    vector: FloatArray  # (3,) float64 rotation vector
    exponential: FloatArray  # (3, 3) float64


class PoseGrads(NamedTuple):
    """Derivatives with respect to all four inputs."""

    d_rotation: FloatArray  # (3, 3)
    d_translation: FloatArray  # (3,)
    d_rotation_vector: FloatArray  # (3,)
    d_offset: FloatArray  # (3,)


def pose_forward(
    rotation: FloatArray, translation: FloatArray, rotation_vector: FloatArray, offset: FloatArray
) -> tuple[FloatArray, FloatArray, PoseSaved]:
    """Equation (B16): rotation' = E rotation, translation' = E translation + offset, E = Exp(rotation_vector).

    rotation         (3, 3)  world to camera; every entry is independent
    translation      (3,)    scene units
    rotation_vector  (3,)    axis times angle in rad, camera axes; any number
    offset           (3,)    scene units, camera axes
    returns  rotation' (3, 3) and translation' (3,), float64; and the saved tuple

    Reverse: pose_reverse, below.
    Edges:   rotation_vector = 0 and offset = 0 return the input pose.
    Oracle:  `endotsr.definition.pose`; scipy.linalg.expm, tests/oracle/pose_oracle.py
    """
    w, d, vector = (np.asarray(array, np.float64) for array in (rotation, translation, rotation_vector))
    a, b, _, _ = _factors(float(vector @ vector))
    k = np.tensordot(vector, CROSS, 1)
    exponential = np.eye(3) + a * k + b * (k @ k)
    return exponential @ w, exponential @ d + offset, PoseSaved(w, d, vector, exponential)


def pose_reverse(d_rotation: FloatArray, d_translation: FloatArray, saved: PoseSaved) -> PoseGrads:
    """Reverse of equation (B16).

    d_rotation     (3, 3)  derivative of the loss with respect to rotation'
    d_translation  (3,)    derivative of the loss with respect to translation'
    returns        the derivatives with respect to the four inputs, float64
    """
    d_w, d_d = (np.asarray(array, np.float64) for array in (d_rotation, d_translation))
    d_exponential = d_w @ saved.rotation.T + np.outer(d_d, saved.translation)
    v, k = saved.vector, np.tensordot(saved.vector, CROSS, 1)
    a, b, a1, b1 = _factors(float(v @ v))
    radial = float((d_exponential * (a1 * k + b1 * (k @ k))).sum())
    d_k = a * d_exponential + b * (d_exponential @ k.T + k.T @ d_exponential)
    d_vector = np.tensordot(CROSS, d_k, 2) + radial * v
    return PoseGrads(saved.exponential.T @ d_w, saved.exponential.T @ d_d, d_vector, d_d.copy())


def _factors(square: float) -> tuple[float, float, float, float]:
    """f = sin r / r, g = (1 - cos r) / r^2, f' / r and g' / r, for r^2 = `square`."""
    if square < SMALL:
        a, b, a1, b1 = (float(np.polynomial.polynomial.polyval(square, terms)) for terms in SERIES)
        return a, b, a1, b1
    r = np.sqrt(square)
    a, b = np.sin(r) / r, 2 * (np.sin(r / 2) / r) ** 2
    return a, b, (np.cos(r) - a) / square, (a - 2 * b) / square
