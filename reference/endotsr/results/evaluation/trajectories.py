"""The motion of a model compared with the true tissue motion of a simulated sequence.

From time t_0 to time t, the model displaces the point visible at pixel p by the displacement of its Gaussians, averaged
with their compositing weights w_k at p:

    D(p, t) = sum_k w_k(p) (mu_k(t) - mu_k(t_0)) / sum_k w_k(p)

The error at p is |D(p, t) - (X(t) - X(t_0))| with the true position X of the material point visible at p. It does not
depend on the rendered depth: a static model with correct depth has the error of the full motion.

In: a model, a sequence and the true positions. Out: means over pixels, reference frames and times.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from endotsr.clips.sequences.forecast.seconds import MOST_REFERENCES, MOST_TIMES
from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.camera import Camera, project
from endotsr.method.splatting.render import Scene, render_forward
from endotsr.results.evaluation.evaluate import training_sample
from endotsr.training.fitting.model import raster_settings, scene_at
from endotsr.training.runs.model import Model

# (reference frame, frame) -> (3, H, W): positions at the second frame of the points visible at the pixels of the first.
TruePositions = Callable[[int, int], FloatArray]

LEAST_OPACITY = 1e-6  # at pixels with a lower opacity the model predicts no motion


class TrajectoryError(NamedTuple):
    """Means over the tissue pixels of the reference frames and over the frames that they are compared with."""

    scene_units: float  # length of the error
    pixels: float  # length of the error in the picture, px
    motion_scene_units: float  # length of the true displacement: the error of a model that does not move
    motion_pixels: float  # the same in the picture, px


def displacement(scene: Scene, moved: Scene, camera: Camera, model: Model) -> FloatArray:
    """Displacement D at every pixel, from a scene to the same Gaussians at another time.

    scene, moved  the Gaussians at the time of the picture and at the other time; N each
    camera        of the picture
    returns       (3, H, W) scene units, world axes; 0 without opacity

    The displacements are rendered as colours, scaled to [-1/2, 1/2] because B4 adds 1/2 and clips at 0.
    """
    moves = moved.position - scene.position
    largest = float(np.abs(moves).max(initial=0.0))
    if largest == 0.0:
        return np.zeros((3, camera.height, camera.width), moves.dtype)
    harmonics = (moves * (0.5 / (largest * Y00)))[None].astype(moves.dtype)
    shown = scene._replace(harmonics=np.ascontiguousarray(harmonics), residual=None)
    rendered, _ = render_forward(shown, camera, raster_settings(model.config), degree=0)
    seen = rendered.opacity > LEAST_OPACITY
    mean = rendered.colour / np.where(seen, rendered.opacity, 1)
    return np.where(seen, (mean - 0.5) * (2.0 * largest), 0)


def trajectory_error(
    model: Model, sequence: Sequence, true_positions: TruePositions, references: Iterable[int] | None = None
) -> TrajectoryError | None:
    """The error of the model's motion from the reference frames to the others; None without a tissue pixel.

    true_positions  from the simulator
    references      frames; default: every sixth training frame, `MOST_REFERENCES` of them in a long clip

    The other frames are all frames, or in a long clip `MOST_TIMES` evenly spaced ones with the first and the last.
    """
    chosen = evenly(training_sample(sequence), MOST_REFERENCES) if references is None else [int(i) for i in references]
    times = evenly(range(sequence.count), MOST_TIMES)

    def scene_of(frame: int) -> Scene:
        return scene_at(model.gaussians, model.spectral, model.config.model, float(sequence.times[frame]))[0]

    scenes = {reference: scene_of(reference) for reference in chosen}
    moved = {frame: (scenes.get(frame) or scene_of(frame)).position for frame in times}
    total, pixels = np.zeros(4), 0
    for reference in chosen:
        positions = true_positions(reference, reference)
        tissue = sequence.masks[reference] & np.isfinite(positions).all(axis=0)  # a wound has no material point
        scene, start, camera = scenes[reference], positions[:, tissue], sequence.cameras[reference]
        for frame in times:
            if frame != reference:  # sums: the lengths of all pairs of a long clip do not fit in memory
                moves = displacement(scene, scene._replace(position=moved[frame]), camera, model)[:, tissue]
                truth = true_positions(reference, frame)[:, tissue]
                total += _lengths(sequence.cameras[frame], start, moves, truth).sum(axis=1)
                pixels += start.shape[1]
    return TrajectoryError(*(float(value) for value in total / pixels)) if pixels else None


def evenly(frames: Iterable[int], most: int) -> list[int]:
    """All frames, or `most` evenly spaced ones of them with the first and the last."""
    every = [int(frame) for frame in frames]
    return [every[k] for k in even_frames(len(every), most)]


def _lengths(camera: Camera, start: FloatArray, moves: FloatArray, truth: FloatArray) -> FloatArray:
    """(4, points): the lengths of `TrajectoryError`; pixels in the camera of the other frame."""
    place, still, moved = (np.stack(project(camera, point)[:2]) for point in (truth, start, start + moves))
    lengths = (start + moves - truth, moved - place, truth - start, place - still)
    return np.stack([np.sqrt(np.square(vector).sum(axis=0)) for vector in lengths])
