"""Equations (B1) and (1) to (3): the moving scene, raw Gaussians at one time with every component applied."""

from collections import namedtuple

import numpy as np

from endotsr.definition.appearance import appearance_forward, appearance_reverse
from endotsr.definition.deformation import deformation_forward, deformation_reverse
from endotsr.definition.dictionary import atom_statistics, dictionary_forward, frequencies, normalised_atoms
from endotsr.definition.matern import matern_weights
from endotsr.definition.motion import motion_forward, motion_reverse
from endotsr.definition.render import Scene

# position (3, N), quaternion (4, N), log_scale (3, N), opacity_logit (N,), harmonics (K, 3, N), fdm_* (10, B, N),
# *_coefficients (3, 2F, N); a component that is off is None
Gaussians = namedtuple(
    "Gaussians",
    "position quaternion log_scale opacity_logit harmonics "
    "fdm_weight fdm_centre fdm_width appearance_coefficients motion_coefficients",
    defaults=[None] * 5,
)
Spectral = namedtuple("Spectral", "omega statistics rho")  # constants of a training
SceneSaved = namedtuple("SceneSaved", "deformation appearance motion")


def arrays(gaussians):
    """The arrays that exist, by name."""
    return {name: array for name, array in gaussians._asdict().items() if array is not None}


def spectral_from(model, train_times):
    """Frequencies (F,), atom statistics over the training times only, and Matern weights (F,)."""
    omega = frequencies(model.frequencies, model.frequency_min, model.frequency_max)
    return Spectral(omega, atom_statistics(train_times, omega), matern_weights(omega, model.correlation_length))


def scene_at(gaussians, spectral, model, t):
    """mu + psi + C phi, q + psi, s + psi and the colour residual at normalised time t, as a Scene."""
    position, quaternion, log_scale, opacity_logit, harmonics, w, theta, sigma, a, c = gaussians
    residual = deformation = appearance = motion = None
    if w is not None:
        psi, deformation = deformation_forward(w, theta, sigma, t, model.basis)
        position, quaternion, log_scale = position + psi[:3], quaternion + psi[3:7], log_scale + psi[7:]
    if c is not None:
        translation, motion = motion_forward(c, dictionary_forward(t, spectral.omega)[0])
        position = position + translation
    if a is not None:
        phi_bar = normalised_atoms(t, spectral.omega, spectral.statistics)
        residual, appearance = appearance_forward(a, phi_bar, model.beta)
    scene = Scene(position, quaternion, log_scale, opacity_logit, harmonics, residual)
    return scene, SceneSaved(deformation, appearance, motion)


def scene_reverse(grads, saved):
    """Gradients with respect to every array of the Gaussians, by name, from the gradients of the Scene."""
    names = ("position", "quaternion", "log_scale", "opacity_logit", "harmonics")
    found = {name: getattr(grads, f"d_{name}") for name in names}
    if saved.deformation is not None:
        d_psi = np.concatenate([grads.d_position, grads.d_quaternion, grads.d_log_scale])
        found |= zip(("fdm_weight", "fdm_centre", "fdm_width"), deformation_reverse(d_psi, saved.deformation))
    if saved.appearance is not None:
        found["appearance_coefficients"] = appearance_reverse(grads.d_residual, saved.appearance)[0]
    if saved.motion is not None:
        found["motion_coefficients"] = motion_reverse(grads.d_position, saved.motion)[0]
    return found
