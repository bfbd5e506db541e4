"""Equation (3): the translation residual of component S, a Fourier series of every Gaussian's centre.

In: coefficients C (3, 2F, N) in scene units and the RAW atoms phi(t) (2F,). Out: translations (3, N) in scene
units, added to the deformed centre. The atoms are not normalised: the penalty of equation (4) is invariant to the
phase of a sine/cosine pair, and different offsets or scales of its two atoms would break this invariance.
"""

from typing import NamedTuple

from endotsr.method.equations.atom_sums import combine, spread
from endotsr.method.kernels.arrays import FloatArray


class MotionSaved(NamedTuple):
    """References to the inputs of the forward pass."""

    motion_coefficients: FloatArray  # (3, 2F, N)
    phi: FloatArray  # (2F,)


class MotionGrads(NamedTuple):
    """Derivative with respect to the coefficients and the atoms."""

    d_motion_coefficients: FloatArray  # (3, 2F, N)
    d_phi: FloatArray | None  # (2F,), None unless requested


def motion_forward(motion_coefficients: FloatArray, phi: FloatArray) -> tuple[FloatArray, MotionSaved]:
    """Equation (3): translation = C phi(t).

    motion_coefficients  (3, 2F, N)  C, scene units; [axis, atom, Gaussian]
    phi                  (2F,)       raw atoms of equation (1) at this time
    returns              (3, N) translation, scene units, dtype of C; and the saved tuple
    Reverse: motion_reverse, below.
    Edges:   C = 0 gives exactly 0; N = 0 works.
    Raises:  ValueError if the shapes disagree.
    Oracle:  `endotsr.definition.motion`
    """
    return combine(motion_coefficients, phi), MotionSaved(motion_coefficients, phi)


def motion_reverse(d_translation: FloatArray, saved: MotionSaved, *, atom_gradient: bool = True) -> MotionGrads:
    """Reverse of equation (3).

    d_translation  (3, N)  derivative of the loss with respect to the translation, loss / scene unit
    returns        gradients of C (3, 2F, N) and phi (2F,), the latter summed in float64, None unless `atom_gradient`
    """
    return MotionGrads(*spread(d_translation, saved.motion_coefficients, saved.phi, atom_gradient=atom_gradient))
