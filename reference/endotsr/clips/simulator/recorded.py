"""The true motion of a folder written by `endotsr simulate`, for the frames of a sequence read from it.

In: the folder and the `Sequence` read from it. Out: world positions as in `SimulatedSequence.true_positions`. The
material point of every pixel comes from `truth/frames`. Its position at another time follows from the formula of the
surface, with the settings in `truth/truth.json`. These files are user input and are checked.
"""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from endotsr.clips.formats.files import has_truth
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.simulator.surface import Surface, make_surface, surface_point
from endotsr.clips.simulator.truth import SceneTruth, read_truth
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray

TOLERANCE = 1e-6  # mm, between the tracks in the file and the formula; both are float64


def check_truth(folder: Path) -> tuple[SceneTruth, Surface]:
    """The truth of a folder and its surface.

    Raises:  InputError as `read_truth` does, or if the tracks contradict the settings.
    """
    truth = read_truth(folder)
    surface = make_surface(truth.settings)
    for t, position in zip(truth.times, truth.tracks.position):
        expected = surface_point(surface, truth.tracks.material, float(t))
        if not np.allclose(position, expected, rtol=0, atol=TOLERANCE):
            path = truth.folder / "tracks.npz"
            raise InputError(f"{path}: position at time {t:g} is not that of the settings; use those of truth.json")
    return truth, surface


def recorded_positions(folder: Path, sequence: Sequence) -> Callable[[int, int], FloatArray] | None:
    """(frame, other frame) of the sequence -> (3, H, W) world positions, mm, at the time of the other frame.

    A position is NaN where the first frame shows a wound. The result is None without truth, or if the size of the
    sequence differs from that of the files.

    Raises:  InputError if the truth is damaged or lacks a frame of the sequence. Files of single frames are read and
             checked on demand.
    """
    if not has_truth(folder):
        return None
    truth, surface = check_truth(folder)
    settings, numbers = truth.settings, {f"{i:06d}": i for i in range(truth.settings.frames)}
    unknown = [name for name in sequence.names if name not in numbers]
    if unknown:
        found = f"{truth.folder}: frame {unknown[0]!r} of the sequence is not in the scene"
        raise InputError(f"{found}; use 000000 to {settings.frames - 1:06d}")
    if (settings.width, settings.height) != (sequence.width, sequence.height):
        return None

    @lru_cache(maxsize=1)  # callers request all times of one frame before the next frame
    def material(frame: int) -> FloatArray:
        return truth.frame(frame).material.astype(np.float64)

    def positions(source: int, target: int) -> FloatArray:
        frame, other = (numbers[sequence.names[i]] for i in (source, target))
        return surface_point(surface, material(frame), float(truth.times[other]))

    return positions
