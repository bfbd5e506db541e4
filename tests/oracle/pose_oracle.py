"""Equation (B16) from the matrix exponential of SciPy, and its derivatives by complex steps."""

import numpy as np
from scipy.linalg import expm


def corrected(rotation, translation, rotation_vector, offset):
    """Rotation (3, 3) and translation (3,) of the corrected pose; complex inputs give complex outputs."""
    x, y, z = rotation_vector
    turn = expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))
    return turn @ rotation, turn @ translation + offset


def gradients(rotation, translation, rotation_vector, offset, d_rotation, d_translation):
    """Derivatives of sum(d_rotation rotation') + sum(d_translation translation') by the four inputs."""
    given = [np.asarray(array, complex) for array in (rotation, translation, rotation_vector, offset)]

    def weighted(arrays):
        turned, moved = corrected(*arrays)
        return (np.asarray(d_rotation) * turned).sum() + (np.asarray(d_translation) * moved).sum()

    found = [np.empty(array.shape) for array in given]
    for which, array in enumerate(given):
        for index in np.ndindex(array.shape):
            moved = [a.copy() for a in given]
            moved[which][index] += 1e-30j
            found[which][index] = weighted(moved).imag / 1e-30
    return found
