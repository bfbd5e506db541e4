"""The path of a camera that a hand holds: slow waves of all six degrees of freedom, and a tremor.

In: settings and times. Out: positions and turns. Each degree of freedom is a sum of sine waves with amplitudes and
phases drawn from the seed. Frame 0 is at the origin, and the largest shift in the plane of the picture
is the amplitude.
"""

from typing import NamedTuple

import numpy as np

from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.method.kernels.arrays import FloatArray

RATES = np.array([0.7, 1.3, 2.1, 4.0, 7.0])  # cycles per sequence: slow motion, then tremor
WEIGHTS = np.array([1.0, 0.7, 0.4, 0.12, 0.06])
EXTENT = np.array([1.0, 0.7, 0.6])  # right, down, forward: relative to each other
TURNS = np.array([0.2, 0.2, 0.4])  # largest pitch, yaw and roll: times amplitude / distance, radians
STREAM = 8  # of the random numbers, so that no other effect changes
SAMPLES = 1024  # times at which the largest value of a wave is looked up


class _Waves(NamedTuple):
    """Sums of sine waves: rates (5,), phases and heights (6, 5)."""

    rate: FloatArray
    phase: FloatArray
    height: FloatArray

    def at(self, times: FloatArray) -> FloatArray:
        """(n, 6), 0 at the time 0."""
        turned = 2 * np.pi * np.asarray(times, float)[:, None, None] * self.rate + self.phase
        return ((np.sin(turned) - np.sin(self.phase)) * self.height).sum(axis=2)


def hand_path(settings: SimulatorSettings, times: FloatArray) -> FloatArray:
    """Camera centres, (n, 3) mm."""
    waves, part = _waves(settings), settings.camera_motion
    shape = EXTENT * waves.at(times)[:, :3]
    every = EXTENT[:2] * waves.at(np.linspace(0, 1, SAMPLES))[:, :2]
    return part.amplitude / np.hypot(*every.T).max() * shape


def hand_rotations(settings: SimulatorSettings, times: FloatArray) -> FloatArray:
    """Turns of the camera about its own axes, (n, 3, 3), beside the one that follows the tissue."""
    from scipy.spatial.transform import Rotation

    waves, part = _waves(settings), settings.camera_motion
    largest = np.abs(waves.at(np.linspace(0, 1, SAMPLES))[:, 3:]).max(axis=0)
    turns = part.amplitude / settings.distance * TURNS / largest * waves.at(times)[:, 3:]
    return Rotation.from_rotvec(turns).as_matrix()


def _waves(settings: SimulatorSettings) -> _Waves:
    rng = np.random.default_rng([settings.seed, STREAM])
    phase = 2 * np.pi * rng.random((6, RATES.size))
    return _Waves(settings.camera_motion.cycles * RATES, phase, WEIGHTS * rng.normal(size=phase.shape))
