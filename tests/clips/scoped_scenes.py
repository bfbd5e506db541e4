"""Simulated scenes with instruments, seen through a scope."""

import msgspec
import numpy as np

from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene


def scene(name, **changes):
    """Pictures and true masks of a small scene."""
    settings = msgspec.structs.replace(named_scene(name), width=160, height=128, frames=5, **changes)
    frames = list(simulated_frames(make_scene(settings)))
    return [frame.image.transpose(1, 2, 0) for frame in frames], [frame.excluded for frame in frames]


def through_a_scope(pictures, seed=7):
    """The pictures in a round field of view: a dark, noisy border with a bright text in it, as a recorder writes it."""
    rng, (height, width) = np.random.default_rng(seed), pictures[0].shape[:2]
    row, column = np.mgrid[:height, :width]
    inside = (row - height / 2) ** 2 + (column - width / 2) ** 2 < (0.42 * height) ** 2
    found = []
    for picture in pictures:
        made = np.where(inside[..., None], picture, rng.integers(0, 9, (height, width, 1))).astype(np.uint8)
        made[4:10, 4:30] = 200  # the name of the hospital
        found.append(made)
    return found, inside
