"""A small simulated clip of a moving scope in front of tissue that does not move, with its true poses."""

from functools import cache

import numpy as np

from endotsr.clips.poses.views import Views, compose, inverse
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import with_settings
from endotsr.method.splatting.camera import CameraPose

SIZE = SimulatorSettings(width=160, height=120, frames=14)
SWING = 10.0  # mm


@cache
def moving_sequence(*effects, seed=0):
    """The sequence; effects beside the moving camera and noise."""
    settings = with_effects(with_settings(SIZE, seed=seed), "camera_motion", "noise", *effects)
    return simulate(with_settings(settings, camera_motion={"amplitude": SWING})).sequence


def moving_views(*effects, seed=0):
    """The views, and the true poses."""
    found = moving_sequence(*effects, seed=seed)
    poses = [CameraPose(camera.rotation, camera.translation) for camera in found.cameras]
    return Views(found.images, found.masks, found.depth, found.cameras[0]), poses


def still_views():
    """A scope at rest in front of tissue that is pulled, moves and beats."""
    found = simulate(with_effects(SIZE, "breathing", "pulsation", "pull", "noise")).sequence
    return Views(found.images, found.masks, found.depth, found.cameras[0])


def centres(poses):
    """Optical centres (n, 3)."""
    return np.array([-pose.rotation.T @ pose.translation for pose in poses])


def path_error(poses, true):
    """RMS distance of the centres, mm, with the first poses on top of each other."""
    common = compose(inverse(true[0]), poses[0])
    moved = [compose(pose, inverse(common)) for pose in poses]
    return float(np.sqrt(np.square(centres(moved) - centres(true)).sum(1).mean()))
