"""Equation (3): the translation residual of component S."""

from collections import namedtuple

import numpy as np

MotionSaved = namedtuple("MotionSaved", "motion_coefficients phi")
MotionGrads = namedtuple("MotionGrads", "d_motion_coefficients d_phi")


def motion_forward(motion_coefficients, phi):
    """Equation (3): translation (3, N) = C phi, scene units; phi (2F,) are the raw atoms."""
    return np.einsum("dkn,k->dn", motion_coefficients, phi), MotionSaved(motion_coefficients, phi)


def motion_reverse(d_translation, saved):
    """Reverse of (3)."""
    c, phi = saved
    return MotionGrads(d_translation[:, None] * phi[:, None], np.einsum("dn,dkn->k", d_translation, c))  # (5.5), (5.6)
