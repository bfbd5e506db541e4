"""Equation (B16): a correction of the camera pose of one frame, by the matrix exponential."""

from collections import namedtuple

import numpy as np

from endotsr.definition.covariance import CROSS

PoseSaved = namedtuple("PoseSaved", "rotation translation rotation_vector")
PoseGrads = namedtuple("PoseGrads", "d_rotation d_translation d_rotation_vector d_offset")


def exponential(matrix):
    """Taylor series of exp(matrix / 2^s), squared s times. The kernel has the closed form for 3 x 3."""
    halvings = max(0, int(np.ceil(np.log2(np.abs(matrix).sum() + 1))))
    term = total = np.eye(len(matrix))
    for k in range(1, 20):
        term = term @ matrix / 2**halvings / k
        total = total + term
    return np.linalg.matrix_power(total, 2**halvings)


def pose_forward(rotation, translation, rotation_vector, offset):
    """Equation (B16): W' = E W (3, 3) and d' = E d + tau (3,), E = exp([omega]_x), omega in rad, tau in scene units."""
    e = exponential(CROSS @ rotation_vector)
    return e @ rotation, e @ translation + offset, PoseSaved(rotation, translation, rotation_vector)


def pose_reverse(d_rotation, d_translation, saved):
    """Reverse of (B16): the derivative of exp is the upper right block of exp [[K, G], [0, K]], K = [omega]_x^T."""
    rotation, translation, vector = saved
    k = (CROSS @ vector).T
    g = d_rotation @ rotation.T + np.outer(d_translation, translation)  # (7.12)
    both = exponential(np.block([[k, g], [np.zeros((3, 3)), k]]))  # (7.14)
    e, d_cross = both[:3, :3].T, both[:3, 3:]
    return PoseGrads(e.T @ d_rotation, e.T @ d_translation, np.einsum("ij,ijk->k", d_cross, CROSS), d_translation)
